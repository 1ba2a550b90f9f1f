//! The foreign interfaces of a headset: the OpenXR loader, Vulkan objects made by its runtime, and raw extensions.
//!
//! All `unsafe` of the player is in this folder. Everything around it sees only owned, typed values.

#![allow(unsafe_code)] // foreign functions; every block says why it is sound

pub(super) mod clock;
pub(super) mod graphics;
pub(super) mod passthrough;
pub(super) mod planes;
mod spatial;
pub(super) mod spatial_anchor;
pub(super) mod spatial_planes;

use openxr::Entry;

use super::XrError;

/// Loads the OpenXR loader of this machine at run time, so that a player without one still starts.
pub(super) fn load() -> Result<Entry, XrError> {
    // SAFETY: the library of this name on the system's search path is the OpenXR loader, which conforms to the
    // specification; a machine on which it is something else is broken for every OpenXR program.
    unsafe { Entry::load(&()) }.map_err(|error| XrError::NoLoader(error.to_string()))
}
