// The match over the picture of the room, hidden where something real is nearer.
//
// Depth pictures are coarse and do not end where the colours end. So the test is averaged over a neighbourhood whose
// pixels count the more, the more they look like the one being drawn (joint bilateral filter, Petschnigg et al. 2004):
// the edge of what hides the match follows the edge in the colour picture.

struct Composite {
  // Light of the room, and opacity of the match.
  light: vec4<f32>,
  picture_px: vec2<f32>,
  target_px: vec2<f32>,
  near_m: f32,
  // What a depth sensor may be wrong by: metres, and metres per square metre of distance.
  slack_m: f32,
  slack_per_m2: f32,
}

@group(0) @binding(0) var<uniform> composite: Composite;
@group(0) @binding(1) var picture: texture_2d<f32>;
@group(0) @binding(2) var picture_sampler: sampler;
@group(0) @binding(3) var room_depth: texture_2d<f32>;
@group(0) @binding(4) var drawn: texture_2d<f32>;
@group(0) @binding(5) var drawn_depth: texture_depth_multisampled_2d;

const SAMPLES: i32 = 4;
const REACH_PX: i32 = 3;
const SPREAD_PX: f32 = 1.6;
const COLOUR_SPREAD: f32 = 0.08;

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
  let at = vec2<f32>(f32((index << 1u) & 2u), f32(index & 2u));
  return vec4<f32>(at * 2.0 - 1.0, 0.0, 1.0);
}

// How much of something at `metres` is seen when the room is at `room_m` there. A shadow is seen only on its surface:
// not on what stands in front, nor where the table has ended.
fn seen(metres: f32, room_m: f32, is_shadow: bool) -> f32 {
  let slack = composite.slack_m + composite.slack_per_m2 * metres * metres;
  if room_m <= 0.0 {
    return select(1.0, 0.0, is_shadow);
  }
  let behind = metres - room_m;
  let hidden = select(behind, abs(behind), is_shadow);
  return 1.0 - smoothstep(slack, 2.0 * slack, hidden);
}

@fragment
fn fragment(@builtin(position) clip: vec4<f32>) -> @location(0) vec4<f32> {
  let uv = clip.xy / composite.target_px;
  let room = textureSampleLevel(picture, picture_sampler, uv, 0.0).rgb;
  let pixel = vec2<i32>(clip.xy);
  let front = textureLoad(drawn, pixel, 0);
  if front.a <= 0.0 {
    return vec4<f32>(room, 1.0);
  }
  // Shadows are black and let light through.
  let is_shadow = front.a < 0.95 && max(front.r, max(front.g, front.b)) <= 0.0;
  var metres = array<f32, 4>(0.0, 0.0, 0.0, 0.0);
  var covered = 0.0;
  for (var index = 0; index < SAMPLES; index++) {
    let depth = textureLoad(drawn_depth, pixel, index);
    if depth > 0.0 {
      metres[index] = composite.near_m / depth;
      covered += 1.0;
    }
  }
  var shown = 1.0;
  if covered > 0.0 {
    let at = uv * composite.picture_px - 0.5;
    let middle = vec2<i32>(round(at));
    let last = vec2<i32>(composite.picture_px) - 1;
    let guide = sqrt(room);
    var sum = 0.0;
    var weights = 0.0;
    for (var row = -REACH_PX; row <= REACH_PX; row++) {
      for (var column = -REACH_PX; column <= REACH_PX; column++) {
        let place = clamp(middle + vec2<i32>(column, row), vec2<i32>(0), last);
        let away = vec2<f32>(place) - at;
        let unlike = sqrt(textureLoad(picture, place, 0).rgb) - guide;
        let weight = exp(-dot(away, away) / (2.0 * SPREAD_PX * SPREAD_PX)
          - dot(unlike, unlike) / (2.0 * COLOUR_SPREAD * COLOUR_SPREAD)) + 1e-6;
        let room_m = textureLoad(room_depth, place, 0).r;
        for (var index = 0; index < SAMPLES; index++) {
          if metres[index] > 0.0 {
            sum += weight * seen(metres[index], room_m, is_shadow);
          }
        }
        weights += weight;
      }
    }
    shown = sum / (weights * covered);
  }
  let share = shown * composite.light.a;
  return vec4<f32>(room * (1.0 - front.a * share) + front.rgb * composite.light.rgb * share, 1.0);
}
