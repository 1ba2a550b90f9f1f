// Turf with mowing stripes and markings, and the wooden table under it.

struct Fragment {
  @builtin(position) clip: vec4<f32>,
  @location(0) world_m: vec3<f32>,
  @location(1) normal: vec3<f32>,
  @location(2) @interpolate(flat) material: u32,
}

@vertex
fn vertex(
  @location(0) position_m: vec3<f32>,
  @location(1) normal: vec3<f32>,
  @location(2) material: u32,
) -> Fragment {
  var out: Fragment;
  out.clip = view.clip_from_world * vec4<f32>(position_m, 1.0);
  out.world_m = position_m;
  out.normal = normal;
  out.material = material;
  return out;
}

// Size of a pixel along `direction` on the ground, metres.
fn footprint_along(direction: vec2<f32>, dx: vec2<f32>, dy: vec2<f32>) -> f32 {
  return length(vec2<f32>(dot(direction, dx), dot(direction, dy))) * 1.2;
}

fn marking_coverage(p: vec2<f32>, dx: vec2<f32>, dy: vec2<f32>) -> f32 {
  var covered = 0.0;
  for (var index = 0u; index < stage.marking_count; index++) {
    let shape = stage.markings[2u * index];
    let kind = stage.markings[2u * index + 1u];
    if kind.x < 0.5 {
      // A line, with square ends half a width beyond its end points so that corners close.
      let along = shape.zw - shape.xy;
      let size = length(along);
      let direction = along / size;
      let side = vec2<f32>(-direction.y, direction.x);
      let from_middle = p - 0.5 * (shape.xy + shape.zw);
      let across = strip_coverage(dot(from_middle, side), kind.y, footprint_along(side, dx, dy));
      if across > 0.0 {
        let reach = 0.5 * size + kind.y;
        covered = max(covered, across
          * strip_coverage(dot(from_middle, direction), reach, footprint_along(direction, dx, dy)));
      }
    } else {
      let from_centre = p - shape.xy;
      let radius = length(from_centre);
      let outward = from_centre / max(radius, 1e-4);
      let footprint = footprint_along(outward, dx, dy);
      if kind.x < 1.5 {
        let across = strip_coverage(radius - shape.z, kind.y, footprint);
        if across > 0.0 {
          let middle = vec2<f32>(cos(shape.w), sin(shape.w));
          let angle = acos(clamp(dot(outward, middle), -1.0, 1.0));
          let tangent = vec2<f32>(-outward.y, outward.x);
          let beyond = (kind.z - angle) * shape.z / max(footprint_along(tangent, dx, dy), 1e-5);
          let whole = select(0.0, 1.0, kind.z > 3.1415);
          covered = max(covered, across * max(clamp(beyond + 0.5, 0.0, 1.0), whole));
        }
      } else {
        covered = max(covered, strip_coverage(radius, shape.z, footprint));
      }
    }
  }
  return covered;
}

fn turf(p: vec2<f32>, dx: vec2<f32>, dy: vec2<f32>, footprint: f32) -> vec3<f32> {
  // Mown in eighteen stripes between the goal lines, as the broadcast shows most pitches.
  let stripe_m = stage.half_pitch_m.x / 9.0;
  let at = (p.x + stage.half_pitch_m.x) / stripe_m;
  let boundary = round(at);
  let to_boundary = (at - boundary) * stripe_m;
  let soft = max(footprint_along(vec2<f32>(1.0, 0.0), dx, dy), 0.16);
  let past = clamp(to_boundary / soft + 0.5, 0.0, 1.0);
  let before_is_light = (i32(boundary) & 1) == 0;
  let light = select(past, 1.0 - past, before_is_light);

  let inside = clamp(0.5 - rounded_box_distance(p, stage.half_pitch_m + vec2<f32>(0.9), 0.1) / 0.5, 0.0, 1.0);
  let mown = mix(vec3<f32>(0.052, 0.150, 0.034), vec3<f32>(0.082, 0.208, 0.048), light);
  let rough = vec3<f32>(0.047, 0.128, 0.034);
  var colour = mix(rough, mown, inside);

  let blades = noise(p * vec2<f32>(1.0, 0.7), 0.09, footprint) * 0.10 + noise(p, 0.35, footprint) * 0.05;
  let patches = noise(p + 31.0, 2.3, footprint) * 0.035 + noise(p - 17.0, 9.0, footprint) * 0.05;
  colour *= 1.0 + blades + patches;

  let paint = marking_coverage(p, dx, dy) * (0.94 + 0.06 * noise(p, 0.05, footprint));
  return mix(colour, vec3<f32>(0.80, 0.83, 0.79), paint);
}

fn wood(p: vec2<f32>, footprint: f32) -> vec3<f32> {
  // Boards along the table; every board has its own tone and shift of the grain.
  let board_m = 13.0;
  let board = floor(p.y / board_m + 0.5);
  let tone = hash(vec2<i32>(i32(board), 7));
  let shifted = vec2<f32>(p.x * 0.055 + tone * 91.0, p.y);
  let wave = noise(shifted * vec2<f32>(1.0, 0.35), 1.6, footprint * 0.35) * 1.6;
  let rings = noise(vec2<f32>(shifted.x, p.y + wave), 0.75, footprint) * 0.5
    + noise(vec2<f32>(shifted.x * 3.0, p.y + wave), 0.24, footprint) * 0.3;
  let dark = vec3<f32>(0.125, 0.066, 0.033);
  let pale = vec3<f32>(0.265, 0.157, 0.083);
  var colour = mix(dark, pale, clamp(0.5 + 0.42 * rings + 0.34 * (tone - 0.5), 0.0, 1.0));
  let to_seam = abs(p.y / board_m - floor(p.y / board_m + 0.5)) * board_m;
  let seam = strip_coverage(to_seam - 0.5 * board_m, 0.07, footprint);
  return colour * (1.0 - 0.55 * seam);
}

@fragment
fn fragment(in: Fragment) -> @location(0) vec4<f32> {
  let p = in.world_m.xz;
  let dx = dpdx(p);
  let dy = dpdy(p);
  let tall = vec2<f32>(dpdx(in.world_m.y), dpdy(in.world_m.y));
  let footprint = max(length(dx), length(dy));
  var colour: vec3<f32>;
  if in.material == 0u {
    colour = turf(p, dx, dy, footprint);
    // The light falls off a little towards the edge of the table.
    let far = length(p / (stage.half_table_m * 1.25));
    colour *= 1.06 - 0.20 * far * far;
  } else if in.material == 1u {
    // The cut side of the turf: grass above, soil below.
    let depth = -in.world_m.y / stage.turf_thickness_m;
    let grain = noise(vec2<f32>(p.x + p.y, in.world_m.y), 0.25, max(footprint, length(tall)));
    let side = mix(vec3<f32>(0.045, 0.110, 0.028), vec3<f32>(0.040, 0.026, 0.016), smoothstep(0.25, 0.55, depth));
    colour = side * (1.0 + 0.25 * grain) * lit(in.normal);
  } else {
    let upright = in.material == 3u;
    let at = select(p, vec2<f32>(p.x + p.y, in.world_m.y * 2.5 + 40.0), upright);
    colour = wood(at, select(footprint, max(footprint, length(tall)), upright)) * lit(in.normal);
    if !upright {
      // Soft shadow of the turf's edge.
      let away = max(rounded_box_distance(p, stage.half_turf_m, stage.turf_corner_m), 0.0);
      colour *= 1.0 - 0.55 * exp(-away * 1.1) - 0.14 * exp(-away * 0.18);
      let far = length(p / (stage.half_table_m * 1.25));
      colour *= 1.10 - 0.42 * far * far;
    } else {
      colour *= 0.62;
    }
  }
  return vec4<f32>(colour, 1.0);
}
