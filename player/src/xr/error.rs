//! What can go wrong with a headset, and whether it is worth trying again.

use openxr::sys::Result as XrResult;
use thiserror::Error;

use crate::offscreen::OffscreenError;

/// Why the headset does not show the match.
#[derive(Debug, Error)]
pub enum XrError {
    /// No OpenXR on this machine.
    #[error("no OpenXR loader ({0}): install one (on Debian: libopenxr-loader1) and a headset's runtime")]
    NoLoader(String),
    /// There is a loader, but nothing behind it, or nothing that can draw with Vulkan.
    #[error("no OpenXR runtime for the player: {0}: start the headset's software, or set XR_RUNTIME_JSON")]
    NoRuntime(String),
    /// The runtime is there, the headset is not.
    #[error("the OpenXR runtime {0} finds no headset: connect it and put it on")]
    NoHeadset(String),
    /// Something with the graphics device.
    #[error("the headset's graphics device cannot be used: {0}")]
    Graphics(String),
    /// The runtime refused a call.
    #[error("the OpenXR runtime says: {0}")]
    Call(#[from] XrResult),
    /// The headset went away and did not come back.
    #[error("the headset was lost and did not come back within {seconds} s: {reason}")]
    Gone {
        /// How long it was tried.
        seconds: u64,
        /// What was last said.
        reason: String,
    },
    /// Nothing to show.
    #[error("{0}")]
    Stream(String),
    /// A picture could not be read back.
    #[error(transparent)]
    Picture(#[from] OffscreenError),
    /// A picture could not be written.
    #[error("{path}: cannot be written: {reason}")]
    Write {
        /// Where to.
        path: String,
        /// Why not.
        reason: String,
    },
}

impl XrError {
    /// Whether a new session, perhaps a new instance, may help.
    #[must_use]
    pub fn is_loss(&self) -> bool {
        match self {
            Self::NoHeadset(_) | Self::NoRuntime(_) => true,
            Self::Call(result) => {
                *result == XrResult::ERROR_SESSION_LOST
                    || *result == XrResult::ERROR_INSTANCE_LOST
                    || *result == XrResult::ERROR_RUNTIME_FAILURE
                    || *result == XrResult::ERROR_RUNTIME_UNAVAILABLE
                    || *result == XrResult::ERROR_FORM_FACTOR_UNAVAILABLE
            }
            _ => false,
        }
    }
}

/// Puts a graphics failure into words.
pub(super) fn graphics<E: std::fmt::Display>(what: &'static str) -> impl Fn(E) -> XrError {
    move |error| XrError::Graphics(format!("{what}: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_are_told_from_mistakes() {
        assert!(XrError::Call(XrResult::ERROR_INSTANCE_LOST).is_loss());
        assert!(XrError::NoHeadset("x".to_owned()).is_loss());
        assert!(!XrError::Call(XrResult::ERROR_VALIDATION_FAILURE).is_loss());
        assert!(!XrError::NoLoader("x".to_owned()).is_loss());
    }
}
