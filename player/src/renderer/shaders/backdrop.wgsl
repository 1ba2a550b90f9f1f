// The room behind the table: a quiet gradient with a soft pool of light.

struct Corner {
  @builtin(position) clip: vec4<f32>,
  @location(0) at: vec2<f32>,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> Corner {
  let at = vec2<f32>(f32((index << 1u) & 2u), f32(index & 2u));
  var out: Corner;
  out.clip = vec4<f32>(at * 2.0 - 1.0, 0.0, 1.0);
  out.at = at;
  return out;
}

@fragment
fn fragment(corner: Corner) -> @location(0) vec4<f32> {
  let from_light = length((corner.at - vec2<f32>(0.5, 0.62)) * vec2<f32>(1.0, 0.8));
  let light = exp(-from_light * from_light * 2.6);
  let low = vec3<f32>(0.022, 0.024, 0.029);
  let high = vec3<f32>(0.105, 0.108, 0.115);
  // Half a step of noise hides the bands of an 8-bit gradient.
  let grain = (hash(vec2<i32>(corner.clip.xy)) - 0.5) * 0.0016;
  return vec4<f32>(mix(low, high, light) + grain, 1.0);
}
