//! Every figure that Holopitch states about itself is computed here, by the definitions of the design's section on
//! measures; one module per measure.

pub mod matches;
mod surface;
