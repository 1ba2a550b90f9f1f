// Nets: threads as box-filtered lines, so that they fade to a veil in the distance and never flicker.

struct Fragment {
  @builtin(position) clip: vec4<f32>,
  @location(0) net_m: vec2<f32>,
}

const MESH_M: f32 = 0.12;
const HALF_THREAD_M: f32 = 0.004;

@vertex
fn vertex(@location(0) position_m: vec3<f32>, @location(1) net_m: vec2<f32>) -> Fragment {
  var out: Fragment;
  out.clip = view.clip_from_world * vec4<f32>(position_m, 1.0);
  out.net_m = net_m;
  return out;
}

fn threads(at: f32, footprint: f32) -> f32 {
  // Beyond half a mesh per pixel the mean is all that is left to see.
  let mean = 2.0 * HALF_THREAD_M / MESH_M;
  let from_thread = (fract(at / MESH_M + 0.5) - 0.5) * MESH_M;
  let sharp = strip_coverage(from_thread, HALF_THREAD_M, min(footprint, MESH_M));
  return mix(sharp, mean, clamp(footprint / MESH_M, 0.0, 1.0));
}

@fragment
fn fragment(in: Fragment) -> @location(0) vec4<f32> {
  let size = vec2<f32>(
    length(vec2<f32>(dpdx(in.net_m.x), dpdy(in.net_m.x))),
    length(vec2<f32>(dpdx(in.net_m.y), dpdy(in.net_m.y))),
  );
  let u = threads(in.net_m.x, size.x * 1.2);
  let v = threads(in.net_m.y, size.y * 1.2);
  let covered = 1.0 - (1.0 - u) * (1.0 - v);
  return vec4<f32>(0.86, 0.87, 0.88, covered * 0.8);
}
