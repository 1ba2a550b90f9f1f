// Marks on real surfaces: a bright line at the edge, a glow inside it, and a faint area.

struct Fragment {
  @builtin(position) clip: vec4<f32>,
  @location(0) inside: f32,
  @location(1) colour: vec4<f32>,
}

@vertex
fn vertex(
  @location(0) position_m: vec3<f32>,
  @location(1) inside: f32,
  @location(2) colour: vec4<f32>,
) -> Fragment {
  var out: Fragment;
  out.clip = view.clip_from_world * vec4<f32>(position_m, 1.0);
  out.inside = inside;
  out.colour = colour;
  return out;
}

@fragment
fn fragment(in: Fragment) -> @location(0) vec4<f32> {
  let line = 1.0 - smoothstep(0.16, 0.28, in.inside);
  let glow = 1.0 - in.inside;
  let alpha = max(0.9 * line, 0.08 + 0.4 * glow * glow);
  return vec4<f32>(in.colour.rgb, in.colour.a * alpha);
}
