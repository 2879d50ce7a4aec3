//! Digests of a design: of its layout, of its optics, and of its simulation.

use serde::Serialize;
use sha2::{Digest, Sha256};

use metalith_cell::Analyser;
use metalith_core::Result;
use metalith_core::text::hex;

use crate::Design;
use crate::spec::{ArraySpec, CellSpec, LayoutSpec, LensSpec, MappingSpec, VerifySpec};

impl Design {
    /// SHA-256 of all that decides the layout (not of what is verified): two designs with the same
    /// digest give the same bytes. In hexadecimal.
    pub fn digest(&self) -> String {
        #[derive(Serialize)]
        struct Decisive<'a>(
            &'a str,
            &'a CellSpec,
            &'a LensSpec,
            &'a ArraySpec,
            &'a MappingSpec,
            &'a LayoutSpec,
        );
        let decisive = Decisive(
            &self.name,
            &self.cell,
            &self.lens,
            &self.array,
            &self.mapping,
            &self.layout,
        );
        let bytes = serde_json::to_vec(&decisive).expect("plain data serialises");
        hex(&Sha256::digest(&bytes))
    }

    /// SHA-256 of all that decides what light does behind the layout, but for what of it is asked in `[verify]`: of
    /// [`Design::digest`], what the tables of its materials say, and its band. In hexadecimal.
    ///
    /// # Errors
    /// If a material is not known or its table cannot be read.
    pub fn optics_digest(&self) -> Result<String> {
        let stack = self.cell_stack()?;
        let band_um = self.band_of(&stack);
        let decisive = (self.digest(), stack, band_um);
        let bytes = serde_json::to_vec(&decisive).expect("plain data serialises");
        Ok(hex(&Sha256::digest(&bytes)))
    }

    /// SHA-256 of all that decides what light is simulated to do behind the layout: of [`Design::optics_digest`] and, of
    /// `[verify]`, the cell, its wavelengths, the polarisation and the analyser. In hexadecimal.
    ///
    /// # Errors
    /// As [`Design::optics_digest`].
    pub fn simulation_digest(&self) -> Result<String> {
        let VerifySpec {
            fidelity,
            wavelengths_um,
            polarisation,
            analyser,
            ..
        } = &self.verify;
        // Digests of designs without a linear analyser are what they were before there was one.
        let circular = *analyser == Some(Analyser::Circular);
        let decisive = (self.optics_digest()?, fidelity, wavelengths_um, circular);
        let bytes = match (polarisation, analyser) {
            (light, Some(Analyser::Linear(deg))) => serde_json::to_vec(&(decisive, light, deg)),
            (Some(light), _) => serde_json::to_vec(&(decisive, light)),
            (None, _) => serde_json::to_vec(&decisive),
        };
        let bytes = bytes.expect("plain data serialises");
        Ok(hex(&Sha256::digest(&bytes)))
    }
}
