// Goals, flags and the ball: their own colours, simply lit.

struct Fragment {
  @builtin(position) clip: vec4<f32>,
  @location(0) normal: vec3<f32>,
  @location(1) colour: vec3<f32>,
}

@vertex
fn vertex(
  @location(0) position_m: vec3<f32>,
  @location(1) normal: vec3<f32>,
  @location(2) colour: vec3<f32>,
) -> Fragment {
  var out: Fragment;
  out.clip = view.clip_from_world * vec4<f32>(position_m, 1.0);
  out.normal = normal;
  out.colour = colour;
  return out;
}

@fragment
fn fragment(in: Fragment) -> @location(0) vec4<f32> {
  return vec4<f32>(in.colour * lit(normalize(in.normal)), 1.0);
}
