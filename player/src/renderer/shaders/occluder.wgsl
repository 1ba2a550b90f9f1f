// A real surface: leaves its depth, so that nothing behind it is drawn, and no colour, so that it is seen itself.

@vertex
fn vertex(@location(0) position_m: vec3<f32>) -> @builtin(position) vec4<f32> {
  return view.clip_from_world * vec4<f32>(position_m, 1.0);
}

@fragment
fn fragment() -> @location(0) vec4<f32> {
  return vec4<f32>(0.0);
}
