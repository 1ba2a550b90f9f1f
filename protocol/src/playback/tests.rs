//! The machine under made-up networks and a clock that the tests own.

mod live;
mod network;
mod player;
mod properties;
mod quality;
mod waiting;
