//! BlazePose's 33 landmarks on a body in its rest pose, so that truth and pose network speak of the same points.

use glam::Vec3;

use crate::body::{BaseBody, Bone, Part, ShapedBody};

/// The 33 landmarks of BlazePose on a body: joints where it has bones, points of the skin elsewhere.
pub(crate) fn of(base: &BaseBody, body: &ShapedBody) -> Vec<(Bone, Vec3)> {
    let skin = || base.triangles(Part::Skin).iter().flatten().map(|&v| body.positions[v as usize]);
    let head = body.head(Bone::Head);
    let furthest = |keep: &dyn Fn(Vec3) -> bool, score: &dyn Fn(Vec3) -> f32| {
        skin().filter(|&p| keep(p)).max_by(|a, b| score(*a).total_cmp(&score(*b))).unwrap_or(head)
    };
    let nose = furthest(&|p| p.x.abs() < 0.01 && p.y > head.y - 0.02 && p.y < head.y + 0.1, &|p| p.z);
    let from_nose = |x: f32, y: f32, z: f32| (Bone::Head, nose + Vec3::new(x, y, z));
    let mut all = vec![
        (Bone::Head, nose),
        from_nose(0.018, 0.042, -0.03),
        from_nose(0.031, 0.042, -0.035),
        from_nose(0.045, 0.040, -0.045),
        from_nose(-0.018, 0.042, -0.03),
        from_nose(-0.031, 0.042, -0.035),
        from_nose(-0.045, 0.040, -0.045),
        from_nose(0.075, 0.015, -0.115),
        from_nose(-0.075, 0.015, -0.115),
        from_nose(0.025, -0.045, -0.025),
        from_nose(-0.025, -0.045, -0.025),
    ];
    let joint = |bone: Bone| (bone, body.head(bone));
    for [left, right] in
        [[Bone::UpperArmL, Bone::UpperArmR], [Bone::LowerArmL, Bone::LowerArmR], [Bone::HandL, Bone::HandR]]
    {
        all.extend([joint(left), joint(right)]);
    }
    // Knuckles of the little finger, the index finger and the thumb, beyond the wrist along the forearm.
    for (forward, across) in [(0.09, -0.03), (0.095, 0.02), (0.05, 0.045)] {
        for [_, elbow, wrist] in crate::body::ARMS {
            let along = (body.head(wrist) - body.head(elbow)).normalize_or(Vec3::NEG_Y);
            let side = along.cross(Vec3::X).normalize_or(Vec3::Z);
            all.push((wrist, body.head(wrist) + along * forward - side * across));
        }
    }
    for [left, right] in
        [[Bone::ThighL, Bone::ThighR], [Bone::CalfL, Bone::CalfR], [Bone::FootL, Bone::FootR]]
    {
        all.extend([joint(left), joint(right)]);
    }
    for foot in [Bone::FootL, Bone::FootR] {
        let side = body.head(foot).x.signum();
        let low = body.head(foot).y;
        let heel = furthest(&|p| p.x * side > 0.0 && p.y < low - 0.02, &|p| -p.z);
        all.push((foot, heel));
    }
    for toe in [Bone::BallL, Bone::BallR] {
        all.push((toe, body.tail(toe)));
    }
    all
}
