// Shadows on what is really there: the turf's own on the table around it, and the match's on both.

struct Light {
  shift: vec2<f32>,
  half_m: vec2<f32>,
  strength: f32,
}

@group(1) @binding(0) var<uniform> light: Light;
@group(1) @binding(1) var shadow_map: texture_2d<f32>;
@group(1) @binding(2) var shadow_sampler: sampler;

struct Fragment {
  @builtin(position) clip: vec4<f32>,
  @location(0) ground_m: vec2<f32>,
  @location(1) @interpolate(flat) on_turf: u32,
}

// Above the contact shadows, under the soles.
const LIFT_M: f32 = 0.012;

// A point of the ground; `clip` is still in world metres.
fn on_ground(ground: vec2<f32>, on_turf: u32) -> Fragment {
  var out: Fragment;
  let height = select(-stage.turf_thickness_m, LIFT_M, on_turf == 1u);
  out.clip = vec4<f32>(ground.x, height, ground.y, 1.0);
  out.ground_m = ground;
  out.on_turf = on_turf;
  return out;
}

// Share of the light that people and goals keep from a point, on a plane that lies `below` metres under the grass.
fn thrown(p: vec2<f32>, below: f32) -> f32 {
  let at = p - light.shift * below;
  var sum = 0.0;
  // A lamp is no point: the shadow is averaged over a quarter of a metre of the pitch.
  for (var row = -1; row <= 1; row++) {
    for (var column = -1; column <= 1; column++) {
      let q = (at + vec2<f32>(f32(column), f32(row)) * 0.12) / light.half_m;
      sum += textureSampleLevel(shadow_map, shadow_sampler, q * 0.5 + 0.5, 0.0).r;
    }
  }
  return sum / 9.0;
}

@fragment
fn fragment(in: Fragment) -> @location(0) vec4<f32> {
  let p = in.ground_m;
  let from_turf = rounded_box_distance(p, stage.half_turf_m, stage.turf_corner_m);
  if in.on_turf == 1u {
    if from_turf > 0.0 {
      discard;
    }
    return vec4<f32>(0.0, 0.0, 0.0, light.strength * thrown(p, 0.0));
  }
  let away = max(from_turf, 0.0);
  // The sky that the turf's edge hides, as on the drawn table.
  let contact = 0.42 * exp(-away * 1.1) + 0.14 * exp(-away * 0.18);
  let thickness = stage.turf_thickness_m;
  let slab = rounded_box_distance(p - light.shift * thickness, stage.half_turf_m, stage.turf_corner_m);
  let direct = max(thrown(p, thickness), clamp(0.5 - slab / 0.5, 0.0, 1.0));
  let edge = rounded_box_distance(p, light.half_m, 6.0);
  let fade = clamp(-edge / 8.0, 0.0, 1.0);
  let left = (1.0 - contact) * (1.0 - light.strength * direct);
  return vec4<f32>(0.0, 0.0, 0.0, (1.0 - left) * fade);
}
