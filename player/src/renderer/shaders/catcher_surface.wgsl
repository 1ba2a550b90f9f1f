// The ground that shows shadows: the outline of the real surface, so that none hangs in the air beside it.

@vertex
fn vertex(@location(0) ground_m: vec2<f32>) -> Fragment {
  var out = on_ground(ground_m, 0u);
  out.clip = view.clip_from_world * out.clip;
  return out;
}
