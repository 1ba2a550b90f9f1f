// The match's shadow as the light throws it on the plane y = 0: people, goals and ball, flattened along the light.

struct Light {
  // How far a shadow moves for each metre of height, against the light.
  shift: vec2<f32>,
  // Half size of the patch of ground that the shadow texture covers, metres.
  half_m: vec2<f32>,
  strength: f32,
}

@group(0) @binding(0) var<uniform> light: Light;

@vertex
fn vertex(@location(0) position_m: vec3<f32>) -> @builtin(position) vec4<f32> {
  let ground = position_m.xz + light.shift * max(position_m.y, 0.0);
  return vec4<f32>(ground.x / light.half_m.x, -ground.y / light.half_m.y, 0.5, 1.0);
}

@fragment
fn fragment() -> @location(0) vec4<f32> {
  return vec4<f32>(1.0);
}
