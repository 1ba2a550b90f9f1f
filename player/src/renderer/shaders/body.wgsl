// People: their texture carries the light of the stadium, so nothing is added to it.

@group(1) @binding(0) var atlas: texture_2d<f32>;
@group(1) @binding(1) var atlas_sampler: sampler;

struct Fragment {
  @builtin(position) clip: vec4<f32>,
  // Centroid: at the rim of a triangle the coordinate must not leave it and pick up the neighbour's colours.
  @location(0) @interpolate(perspective, centroid) uv: vec2<f32>,
  @location(1) @interpolate(perspective, centroid) tint: vec3<f32>,
}

@vertex
fn vertex(@location(0) position_m: vec3<f32>, @location(1) uv: vec2<f32>, @location(2) tint: vec4<f32>) -> Fragment {
  var out: Fragment;
  out.clip = view.clip_from_world * vec4<f32>(position_m, 1.0);
  out.uv = uv;
  // sRGB to linear.
  let low = tint.rgb / 12.92;
  let high = pow((tint.rgb + 0.055) / 1.055, vec3<f32>(2.4));
  out.tint = select(high, low, tint.rgb <= vec3<f32>(0.04045));
  return out;
}

@fragment
fn fragment(in: Fragment) -> @location(0) vec4<f32> {
  return vec4<f32>(textureSample(atlas, atlas_sampler, in.uv).rgb * in.tint, 1.0);
}
