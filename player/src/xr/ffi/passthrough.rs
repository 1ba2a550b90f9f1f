//! The headset's camera picture under ours, for headsets that mix it in as a layer (XR_FB_passthrough: Quest, Pico).
//!
//! Runtimes with the blend mode `ALPHA_BLEND` need nothing of this. Written to the specification; no runtime that has the
//! extension was at hand to run it on.

use std::ptr;

use openxr::{
    CompositionLayerBase, CompositionLayerFlags, Passthrough, PassthroughFlagsFB, PassthroughLayerFB,
    PassthroughLayerPurposeFB, Session, Vulkan, sys, sys::Handle as _,
};

use crate::xr::XrError;

/// A running camera picture.
pub(in crate::xr) struct CameraPicture {
    /// What the compositor is told; names `layer`.
    description: sys::CompositionLayerPassthroughFB,
    _layer: PassthroughLayerFB,
    /// Dropped after the layer, as it must.
    _passthrough: Passthrough,
}

impl CameraPicture {
    pub(in crate::xr) fn start(session: &Session<Vulkan>) -> Result<Self, XrError> {
        let running = PassthroughFlagsFB::IS_RUNNING_AT_CREATION;
        let passthrough = session.create_passthrough(running)?;
        let purpose = PassthroughLayerPurposeFB::RECONSTRUCTION;
        let layer = session.create_passthrough_layer(&passthrough, running, purpose)?;
        let description = sys::CompositionLayerPassthroughFB {
            ty: sys::CompositionLayerPassthroughFB::TYPE,
            next: ptr::null(),
            flags: CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA,
            space: sys::Space::NULL,
            layer_handle: *layer.inner(),
        };
        Ok(Self { description, _layer: layer, _passthrough: passthrough })
    }

    /// The layer to hand over below all others.
    pub(in crate::xr) fn layer(&self) -> &CompositionLayerBase<'_, Vulkan> {
        // SAFETY: every composition layer begins with the base header, of which `CompositionLayerBase` is a transparent
        // wrapper; the layer handle in it lives as long as `self`, from which the reference is borrowed.
        unsafe { &*(&raw const self.description).cast() }
    }
}
