//! What a person wears and looks like: kit colours and patterns, cut of the clothes, hair, skin.
//! Colours are sRGB as a viewer would name them; [`linear`] turns them into light.

use glam::Vec3;
use rand::{Rng, seq::IndexedRandom};

use crate::body::Build;

/// An sRGB colour, 0..1 per channel.
pub type Srgb = [f32; 3];

/// sRGB to linear light.
#[must_use]
pub fn linear(colour: Srgb) -> Vec3 {
    Vec3::from(colour.map(|c| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }))
}

/// Linear light to sRGB.
#[must_use]
pub fn to_srgb(light: Vec3) -> Srgb {
    light.to_array().map(|c| {
        let c = c.clamp(0.0, 1.0);
        if c <= 0.003_130_8 { c * 12.92 } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
    })
}

/// CIELAB under D65 (ISO/CIE 11664-4).
#[must_use]
pub fn lab(colour: Srgb) -> Vec3 {
    let light = linear(colour);
    let x = light.dot(Vec3::new(0.4124, 0.3576, 0.1805)) / 0.9505;
    let y = light.dot(Vec3::new(0.2126, 0.7152, 0.0722));
    let z = light.dot(Vec3::new(0.0193, 0.1192, 0.9505)) / 1.089;
    let f = |t: f32| if t > 0.008_856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 };
    Vec3::new(116.0 * f(y) - 16.0, 500.0 * (f(x) - f(y)), 200.0 * (f(y) - f(z)))
}

/// The pattern of a shirt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pattern {
    /// One colour.
    Plain,
    /// Upright stripes this wide, metres.
    Stripes(f32),
    /// Hoops this high, metres.
    Hoops(f32),
    /// Left half in the second colour.
    Halves,
    /// Sleeves in the second colour.
    Sleeves,
    /// One diagonal band this wide, metres.
    Sash(f32),
}

/// The colours of a team.
#[derive(Clone, Debug, PartialEq)]
pub struct Kit {
    /// Name, for the truth file and for holding kits out.
    pub id: String,
    /// Main colour of the shirt.
    pub shirt: Srgb,
    /// Second colour of the shirt.
    pub second: Srgb,
    /// How they are laid out.
    pub pattern: Pattern,
    /// Cuffs and collar.
    pub trim: Srgb,
    /// Shorts.
    pub shorts: Srgb,
    /// Socks.
    pub socks: Srgb,
    /// The number on the back.
    pub number: Srgb,
    /// What is printed across the chest.
    pub sponsor: Option<Sponsor>,
}

/// The block across the chest: an invented name, or letters on a bar.
#[derive(Clone, Debug, PartialEq)]
pub struct Sponsor {
    /// Capital letters and digits.
    pub text: String,
    /// Colour of the letters.
    pub ink: Srgb,
    /// Colour of the bar behind them, when there is one.
    pub bar: Option<Srgb>,
}

/// How long the sleeves are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Sleeves {
    Short,
    Long,
}

/// A hair style: the scalp, lifted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hair {
    /// Colour.
    pub colour: Srgb,
    /// How far it stands off the scalp, metres.
    pub volume_m: f32,
    /// Height of the hairline over the head joint at the forehead, metres.
    pub forehead_m: f32,
    /// How far below the head joint it hangs at the nape, metres.
    pub nape_m: f32,
    /// What is tied together behind.
    pub tied: Tied,
}

/// Long hair during a match.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tied {
    /// Nothing is long enough.
    No,
    /// A knot of this radius, metres.
    Knot(f32),
    /// A tail this long, metres.
    Tail(f32),
}

impl Hair {
    /// A random style: short to full for men, mostly tied for women.
    pub fn random(rng: &mut impl Rng, colour: Option<Srgb>, female: bool) -> Self {
        let tied = match rng.random_range(0.0..1.0f32) {
            share if share < if female { 0.65 } else { 0.03 } => Tied::Tail(rng.random_range(0.16..0.30)),
            share if share < if female { 0.90 } else { 0.09 } => Tied::Knot(rng.random_range(0.028..0.045)),
            _ => Tied::No,
        };
        let volume_m = match tied {
            Tied::No => *[0.004, 0.008, 0.014, 0.02, 0.03, 0.055].choose(rng).unwrap_or(&0.01),
            _ => 0.007,
        };
        Self {
            colour: colour.unwrap_or([0.07, 0.06, 0.06]),
            volume_m,
            forehead_m: rng.random_range(0.135..0.16),
            nape_m: if rng.random_bool(0.2) { 0.06 } else { 0.0 },
            tied,
        }
    }
}

/// Everything about a person's looks but the build.
#[derive(Clone, Debug, PartialEq)]
pub struct Outfit {
    /// Team colours.
    pub kit: Kit,
    /// Number on the back and shorts.
    pub number: Option<u8>,
    /// Skin.
    pub skin: Srgb,
    /// Hair; `None` is bald.
    pub hair: Option<Hair>,
    /// Boots.
    pub boots: Srgb,
    /// Goalkeepers' gloves.
    pub gloves: Option<Srgb>,
    /// Sleeve length.
    pub sleeves: Sleeves,
    /// Length of a short sleeve as a share of the upper arm.
    pub sleeve_share: f32,
    /// How far the shirt reaches below the hip joints, metres.
    pub shirt_length_m: f32,
    /// How far above the knee the shorts end, metres.
    pub shorts_above_knee_m: f32,
    /// How far below the knee the socks end, metres.
    pub sock_below_knee_m: f32,
    /// How loosely the clothes hang, metres off the body.
    pub looseness_m: f32,
}

const SKINS: [Srgb; 7] = [
    [0.93, 0.76, 0.66],
    [0.88, 0.68, 0.56],
    [0.80, 0.60, 0.46],
    [0.68, 0.48, 0.35],
    [0.53, 0.35, 0.25],
    [0.40, 0.26, 0.19],
    [0.29, 0.19, 0.15],
];
const HAIRS: [Srgb; 6] = [
    [0.07, 0.06, 0.06],
    [0.12, 0.09, 0.07],
    [0.22, 0.15, 0.10],
    [0.38, 0.26, 0.16],
    [0.70, 0.55, 0.33],
    [0.45, 0.22, 0.12],
];
/// Colours of goalkeepers' gloves.
pub const GLOVES: [Srgb; 5] =
    [[0.93, 0.93, 0.93], [0.12, 0.12, 0.13], [0.75, 0.92, 0.15], [0.95, 0.45, 0.10], [0.20, 0.45, 0.90]];
const BOOTS: [Srgb; 7] = [
    [0.05, 0.05, 0.06],
    [0.95, 0.95, 0.95],
    [0.95, 0.30, 0.10],
    [0.80, 0.95, 0.15],
    [0.95, 0.20, 0.50],
    [0.15, 0.45, 0.95],
    [0.95, 0.80, 0.15],
];

impl Build {
    /// A random adult player, one in seven a woman.
    pub fn random(rng: &mut impl Rng) -> Self {
        let female = rng.random_bool(0.15);
        Self::of(rng, female, false)
    }

    /// A random woman or man; goalkeepers are taller. Heights as in squad lists: men 1.68 to 1.96 m, women 1.58 to 1.80 m.
    pub fn of(rng: &mut impl Rng, female: bool, keeper: bool) -> Self {
        let raw = [0; 3].map(|_| rng.random_range(0.05..1.0f32));
        let sum: f32 = raw.iter().sum();
        Self {
            female: if female { 1.0 } else { 0.0 },
            origin: raw.map(|share| share / sum),
            muscle: rng.random_range(-0.2..0.6),
            weight: rng.random_range(-0.6..0.35),
            height_m: match (female, keeper) {
                (false, false) => rng.random_range(1.68..1.96),
                (false, true) => rng.random_range(1.84..2.0),
                (true, false) => rng.random_range(1.58..1.80),
                (true, true) => rng.random_range(1.70..1.85),
            },
        }
    }
}

impl Outfit {
    /// A random person in `kit`.
    pub fn random(rng: &mut impl Rng, kit: Kit, number: Option<u8>, female: bool) -> Self {
        let tone = rng.random_range(0..SKINS.len());
        let skin = SKINS[tone].map(|c| (c * rng.random_range(0.94..1.06f32)).min(1.0));
        // Fair hair on dark skin is rare.
        let hair_choices = if tone >= 3 { 3 } else { HAIRS.len() };
        let bald = !female && rng.random_bool(0.05);
        let colour = HAIRS[..hair_choices].choose(rng).copied();
        let hair = (!bald).then(|| Hair::random(rng, colour, female));
        Self {
            kit,
            number,
            skin,
            hair,
            boots: *BOOTS.choose(rng).unwrap_or(&BOOTS[0]),
            gloves: None,
            sleeves: if rng.random_bool(0.15) { Sleeves::Long } else { Sleeves::Short },
            sleeve_share: rng.random_range(0.62..0.92),
            shirt_length_m: rng.random_range(0.03..0.10),
            shorts_above_knee_m: rng.random_range(0.08..0.17),
            sock_below_knee_m: rng.random_range(0.03..0.09),
            looseness_m: rng.random_range(0.008..0.024),
        }
    }
}

const WHITE: Srgb = [0.95, 0.95, 0.96];
const BLACK: Srgb = [0.06, 0.06, 0.07];
/// Shirt colours; the first eight dress most clubs.
const PALETTE: [Srgb; 16] = [
    WHITE,
    [0.75, 0.08, 0.12],
    [0.08, 0.16, 0.55],
    [0.35, 0.65, 0.90],
    [0.05, 0.08, 0.25],
    BLACK,
    [0.95, 0.85, 0.10],
    [0.48, 0.07, 0.15],
    [0.95, 0.50, 0.08],
    [0.05, 0.40, 0.18],
    [0.40, 0.15, 0.50],
    [0.90, 0.45, 0.60],
    [0.20, 0.75, 0.70],
    [0.55, 0.57, 0.60],
    [0.70, 0.90, 0.20],
    [0.40, 0.25, 0.15],
];
/// Invented.
const SPONSORS: [&str; 8] =
    ["HARBOUR", "NORTH TEA", "OPEN GOAL", "FORGE", "LUMEN", "TABLETOP", "ORCHARD", "KITE 20"];

impl Pattern {
    fn random(rng: &mut impl Rng) -> Self {
        match rng.random_range(0..10) {
            0..5 => Self::Plain,
            5 | 6 => Self::Stripes(rng.random_range(0.04..0.1)),
            7 => Self::Hoops(rng.random_range(0.05..0.12)),
            8 => Self::Sleeves,
            _ if rng.random_bool(0.5) => Self::Halves,
            _ => Self::Sash(rng.random_range(0.08..0.16)),
        }
    }
}

impl Kit {
    /// A random kit of any colours, for training; `id` names it.
    pub fn random(rng: &mut impl Rng, id: String) -> Self {
        let mut pick = |share_white: f64| -> Srgb {
            if rng.random_bool(share_white) {
                return WHITE;
            }
            let colour = *PALETTE.choose(rng).unwrap_or(&WHITE);
            colour.map(|c| (c * rng.random_range(0.85..1.1f32)).clamp(0.03, 0.97))
        };
        let (shirt, second, trim) = (pick(0.15), pick(0.3), pick(0.3));
        let (shorts, socks) = (pick(0.3), pick(0.2));
        let pattern = Pattern::random(rng);
        let shorts = if rng.random_bool(0.35) { shirt } else { shorts };
        let socks = if rng.random_bool(0.5) { shirt } else { socks };
        Self { shorts, socks, ..Self::printed(rng, id, pattern, [shirt, second, trim]) }
    }

    /// A kit as a club would choose it: a common colour, one other that goes with it.
    pub fn believable<R: Rng>(rng: &mut R, id: String) -> Self {
        let common = if rng.random_bool(0.8) { 8 } else { PALETTE.len() };
        let shirt =
            PALETTE[rng.random_range(0..common)].map(|c| (c * rng.random_range(0.92..1.06f32)).min(0.97));
        let bright = shirt.iter().sum::<f32>() > 1.4;
        let second = match rng.random_range(0..4) {
            0 | 1 if bright => [[0.05, 0.08, 0.25], BLACK, [0.75, 0.08, 0.12], [0.08, 0.16, 0.55]]
                .choose(rng)
                .copied()
                .unwrap_or(BLACK),
            2 | 3 if !bright => {
                *[[0.95, 0.85, 0.10], [0.35, 0.65, 0.90], [0.75, 0.08, 0.12]].choose(rng).unwrap_or(&WHITE)
            }
            _ if bright => BLACK,
            _ => WHITE,
        };
        let pattern = Pattern::random(rng);
        let pick = |rng: &mut R| [shirt, shirt, second, WHITE, BLACK].choose(rng).copied().unwrap_or(shirt);
        let shorts = pick(rng);
        let socks = if rng.random_bool(0.5) { shirt } else { shorts };
        Self { shorts, socks, ..Self::printed(rng, id, pattern, [shirt, second, second]) }
    }

    /// The shirt's number and sponsor in colours that can be read.
    fn printed(rng: &mut impl Rng, id: String, pattern: Pattern, [shirt, second, trim]: [Srgb; 3]) -> Self {
        let dark_ink = shirt.iter().sum::<f32>() > 1.5;
        let number = if dark_ink { [0.05, 0.05, 0.08] } else { [0.95, 0.95, 0.95] };
        let sponsor = rng.random_bool(0.8).then(|| {
            let bar = rng.random_bool(0.3).then_some(if dark_ink { WHITE } else { BLACK });
            let text = SPONSORS.choose(rng).copied().unwrap_or("FORGE").to_owned();
            Sponsor { text, ink: number, bar }
        });
        Self { id, shirt, second, pattern, trim, shorts: shirt, socks: shirt, number, sponsor }
    }
}
