// The ground that shows shadows: six corners for a patch of the table, six for the turf.

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> Fragment {
  let on_turf = index / 6u;
  let corner = index % 6u;
  let at = vec2<f32>(f32(corner == 1u || corner == 2u || corner == 4u), f32(corner == 2u || corner >= 4u)) * 2.0 - 1.0;
  var out = on_ground(at * select(light.half_m, stage.half_turf_m, on_turf == 1u), on_turf);
  out.clip = view.clip_from_world * out.clip;
  return out;
}
