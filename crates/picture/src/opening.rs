//! How a studio is opened: kernels and veil of a chip made, or taken from the disk.

use std::path::Path;

use metalith_cell::cache_folder;
use metalith_core::file::file_digest;
use metalith_core::text::hex;
use metalith_core::{Error, Progress, Result};
use metalith_design::{Design, cell_models};
use metalith_gds::extract::Extraction;
use metalith_layout::read_pillars;
use metalith_optics::{AsBuiltChip, CalibratedModel, SimulationCase};
use metalith_sensor::Camera;

use crate::imaging_system::ImagingSystem;
use crate::kept::KernelCache;
use crate::kernel_plan::Wanted;
use crate::layout::{PillarCount, check_elements};
use crate::scene::SceneImage;
use crate::{SceneView, cache};

impl ImagingSystem {
    /// For a layout of a design behind a camera file, as drawn or as a calibrated model says, and scenes of a field. Kernels
    /// and veil are kept on the disk.
    ///
    /// # Errors
    /// If the layout cannot be read or has no pillars in one of the elements, the camera does not
    /// see the chip, a scene is wider than the array sees, a spectral cube has not the wavelengths that the camera counts, kernels or
    /// veil are too large, or the user stopped it. That they cannot be kept is a warning to `progress`, and so are pillars that are
    /// not those of the design, and scenes with finer pixels than are simulated ([`simulated_view`](crate::simulated_view)).
    pub fn open(
        design: &Design,
        layout: &Path,
        camera: &Camera,
        model: Option<&CalibratedModel>,
        scene: &SceneImage,
        progress: &dyn Progress,
    ) -> Result<Self> {
        Self::open_kept(design, layout, camera, model, scene, &KernelCache::of_user(), progress)
    }

    /// The same with kernels and veil that are kept elsewhere.
    ///
    /// # Errors
    /// As [`ImagingSystem::open`]; if nothing may be made and something is not there, or what was made cannot be kept in a folder that
    /// was asked for.
    pub fn open_kept(
        design: &Design,
        layout: &Path,
        camera: &Camera,
        model: Option<&CalibratedModel>,
        scene: &SceneImage,
        kept: &KernelCache,
        progress: &dyn Progress,
    ) -> Result<Self> {
        Self::open_wanted(
            Wanted::new(design, camera, scene)?,
            design,
            layout,
            model,
            kept,
            progress,
        )
    }

    /// For what was said to be wanted of a design.
    pub(crate) fn open_wanted(
        wanted: Wanted<'_>,
        design: &Design,
        layout: &Path,
        model: Option<&CalibratedModel>,
        kept: &KernelCache,
        progress: &dyn Progress,
    ) -> Result<Self> {
        progress.begin("reading the layout", 1);
        let digest = hex(&file_digest(layout)?);
        let inputs = wanted.inputs(&digest, model)?;
        let SceneView {
            rows,
            columns,
            field_deg,
            ..
        } = wanted.scene.view;
        let field = format!("{rows}x{columns} {field_deg}");
        let veil_inputs = [&inputs[..], field.as_bytes()].concat();
        let folder = kept.folder.as_deref();
        let bank = folder.and_then(|f| cache::kept_bank(f, &inputs));
        let veil = folder.and_then(|f| cache::kept_veil(f, &veil_inputs));
        let from_cache = [bank.is_some(), veil.is_some()];
        if let (
            KernelCache {
                folder: Some(folder),
                make: false,
                ..
            },
            [false, _] | [_, false],
        ) = (kept, from_cache)
        {
            return Err(Error::invalid(
                format!("{} does not hold the kernels of this camera", folder.display()),
                "plan the set again; a shard makes no kernels of its own",
            ));
        }
        let read = || {
            let extraction = read_pillars(design, layout, progress)?;
            check_elements(design, &extraction).map(|()| extraction)
        };
        let mut extraction = None;
        let count_inputs = format!("{digest} {}", design.digest()).into_bytes();
        let mut pillars = folder.and_then(|f| cache::kept_pillars(f, &count_inputs));
        if pillars.is_none() && kept.make {
            let count = PillarCount::of(design, extraction.insert(read()?), progress)?;
            let write = |folder: &Path| cache::keep_pillars(folder, &count_inputs, &count);
            kept.keep("the count of the pillars is", write, progress)?;
            pillars = Some(count);
        }
        let notes = pillars.as_ref().and_then(PillarCount::note);
        notes
            .into_iter()
            .chain(wanted.averaging())
            .for_each(|note| progress.warn(&note));
        let (bank, veil) = match (bank, veil) {
            (Some(bank), Some(veil)) => (bank, veil),
            (bank, _) => {
                let extraction = match extraction {
                    Some(extraction) => extraction,
                    None => read()?,
                };
                let models;
                let made;
                let case = match model {
                    Some(model) => {
                        made = AsBuiltChip::in_light(&design.lit_stack()?, model)?.kept_in(cache_folder().as_deref());
                        SimulationCase::from(&made)
                    }
                    None => {
                        models = cell_models(design, &[design.verify.fidelity])?;
                        models[0].as_ref().into()
                    }
                };
                let chip = wanted.chip(&extraction, case, progress)?;
                let bank = match bank {
                    Some(bank) => bank,
                    None => {
                        let bank = wanted.bank(&chip, progress)?;
                        let write = |folder: &Path| cache::keep_bank(folder, &inputs, &bank);
                        kept.keep("the kernels are", write, progress)?;
                        bank
                    }
                };
                let veil = wanted.veil(&chip, &bank, progress)?;
                let write = |folder: &Path| cache::keep_veil(folder, &veil_inputs, &veil);
                kept.keep("the veil is", write, progress)?;
                (bank, veil)
            }
        };
        Ok(Self {
            from_cache,
            pillars,
            ..wanted.studio(bank, veil)?
        })
    }

    /// For pillars that were read and a case that is at hand, such as one of many draws of a chip: nothing is kept on the
    /// disk. `nodes`: places an axis of the field of each element at which kernels are formed, as many as for [`ImagingSystem::open`]
    /// if left out.
    ///
    /// # Errors
    /// As [`ImagingSystem::open`].
    pub fn of_pillars(
        design: &Design,
        extraction: &Extraction,
        case: SimulationCase<'_>,
        camera: &Camera,
        scene: &SceneImage,
        nodes: Option<usize>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut wanted = Wanted::new(design, camera, scene)?;
        check_elements(design, extraction)?;
        if let Some(nodes) = nodes {
            wanted = wanted.with_nodes(nodes);
        }
        let chip = wanted.chip(extraction, case, progress)?;
        let bank = wanted.bank(&chip, progress)?;
        let veil = wanted.veil(&chip, &bank, progress)?;
        wanted.studio(bank, veil)
    }
}
