// What no camera saw of people, when it is shown as a guess: pale glass.

const GLASS: vec4<f32> = vec4<f32>(0.55, 0.72, 0.95, 0.3);

@vertex
fn vertex(@location(0) position_m: vec3<f32>) -> @builtin(position) vec4<f32> {
  return view.clip_from_world * vec4<f32>(position_m, 1.0);
}

@fragment
fn fragment() -> @location(0) vec4<f32> {
  return GLASS;
}
