// Soft contact shadows on the grass, one instance each.

struct Fragment {
  @builtin(position) clip: vec4<f32>,
  @location(0) at: vec2<f32>,
  @location(1) strength: f32,
}

// Above the grass by so little that no foot sinks in.
const LIFT_M: f32 = 0.008;

@vertex
fn vertex(
  @builtin(vertex_index) index: u32,
  @location(0) centre_m: vec2<f32>,
  @location(1) half_m: vec2<f32>,
  @location(2) strength: f32,
) -> Fragment {
  let at = vec2<f32>(f32(index & 1u), f32(index >> 1u)) * 2.0 - 1.0;
  let ground = centre_m + at * half_m;
  var out: Fragment;
  out.clip = view.clip_from_world * vec4<f32>(ground.x, LIFT_M, ground.y, 1.0);
  out.at = at;
  out.strength = strength;
  return out;
}

@fragment
fn fragment(in: Fragment) -> @location(0) vec4<f32> {
  let r2 = dot(in.at, in.at);
  let fall = max(1.0 - r2, 0.0);
  return vec4<f32>(0.0, 0.0, 0.0, in.strength * fall * fall);
}
