// Shared by every pipeline. World metres: origin at the centre mark, x along the touchline, y up, z to the main camera.

struct View {
  clip_from_world: mat4x4<f32>,
  eye_m: vec4<f32>,
}

struct StageSizes {
  half_pitch_m: vec2<f32>,
  half_turf_m: vec2<f32>,
  half_table_m: vec2<f32>,
  turf_corner_m: f32,
  turf_thickness_m: f32,
  marking_count: u32,
  // Two vectors per marking, see `scene::Stage::markings`. The array fills a uniform of 2 kB.
  markings: array<vec4<f32>, 120>,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> stage: StageSizes;

const SUN: vec3<f32> = vec3<f32>(0.36, 0.84, 0.40);

// Key light from above the main stand, soft light from the sky, a little from the grass.
fn lit(normal: vec3<f32>) -> f32 {
  let key = max(dot(normal, SUN), 0.0);
  let sky = 0.5 + 0.5 * normal.y;
  return 0.34 + 0.28 * sky + 0.46 * key;
}

// How much of a strip |distance| <= half_width lies in a pixel that is `footprint` wide: exact for a box filter, so
// that lines thinner than a pixel fade and do not flicker.
fn strip_coverage(distance: f32, half_width: f32, footprint: f32) -> f32 {
  let half_pixel = max(footprint, 1e-5) * 0.5;
  let high = clamp(distance + half_pixel, -half_width, half_width);
  let low = clamp(distance - half_pixel, -half_width, half_width);
  return (high - low) / (2.0 * half_pixel);
}

fn rounded_box_distance(p: vec2<f32>, half_size: vec2<f32>, corner: f32) -> f32 {
  let q = abs(p) - half_size + corner;
  return length(max(q, vec2<f32>(0.0))) + min(max(q.x, q.y), 0.0) - corner;
}

// Integer hash (PCG 2D): the same bits on every driver, unlike sin().
fn hash(cell: vec2<i32>) -> f32 {
  var v = bitcast<vec2<u32>>(cell) * 1664525u + 1013904223u;
  v.x += v.y * 1664525u;
  v.y += v.x * 1664525u;
  v = v ^ (v >> vec2<u32>(16u));
  v.x += v.y * 1664525u;
  v.y += v.x * 1664525u;
  v = v ^ (v >> vec2<u32>(16u));
  return f32(v.x >> 8u) / 16777216.0;
}

// Value noise, -1..1, faded out where its cells are smaller than a pixel.
fn noise(p: vec2<f32>, cell_m: f32, footprint: f32) -> f32 {
  let fade = clamp(1.5 - 1.5 * footprint / cell_m, 0.0, 1.0);
  if fade <= 0.0 {
    return 0.0;
  }
  let q = p / cell_m;
  let cell = vec2<i32>(floor(q));
  let f = fract(q);
  let w = f * f * (3.0 - 2.0 * f);
  let low = mix(hash(cell), hash(cell + vec2<i32>(1, 0)), w.x);
  let high = mix(hash(cell + vec2<i32>(0, 1)), hash(cell + vec2<i32>(1, 1)), w.x);
  return (mix(low, high, w.y) * 2.0 - 1.0) * fade;
}
