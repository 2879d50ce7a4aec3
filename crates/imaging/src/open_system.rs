//! Opening of an imaging system: kernels and stray light of a chip made, or taken from the disk.

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

use crate::cache_file;
use crate::geometry::SceneView;
use crate::imaging_system::ImagingSystem;
use crate::kernel_cache::KernelCache;
use crate::kernel_parts::KernelParts;
use crate::kernel_plan::KernelPlan;
use crate::layout::{PillarCount, check_elements};
use crate::scene::SceneImage;

/// Inputs of the stray light that pixels count, beside those of the kernels; none where pixels count all light.
fn arrival_inputs(camera: &Camera) -> String {
    let sensor = &camera.sensor;
    if sensor.counts_all_light() {
        return String::new();
    }
    format!(" {:?} {:?}", sensor.angular_response, sensor.walls)
}

impl ImagingSystem {
    /// Opens a system for a layout of a design behind a camera file, as drawn or as a calibrated model says, and scenes
    /// of a field. Kernels and stray light are kept on the disk.
    ///
    /// # Errors
    /// If the layout cannot be read or has no pillars in one of the elements, the camera does not
    /// see the chip, a scene is wider than the array sees, a spectral cube has not the wavelengths that the camera counts, kernels or
    /// stray light are too large, or the user stopped it. That they cannot be kept is a warning to `progress`, and so are pillars that are
    /// not those of the design, and scenes with finer pixels than are simulated ([`simulated_view`](crate::simulated_view)).
    pub fn open(
        design: &Design,
        layout: &Path,
        camera: &Camera,
        model: Option<&CalibratedModel>,
        scene: &SceneImage,
        progress: &dyn Progress,
    ) -> Result<Self> {
        Self::open_cached(design, layout, camera, model, scene, &KernelCache::of_user(), progress)
    }

    /// Variant of [`ImagingSystem::open`] with kernels and stray light that are cached elsewhere.
    ///
    /// # Errors
    /// As [`ImagingSystem::open`]; if nothing may be made and something is not there, or what was made cannot be kept in a folder that
    /// was asked for.
    pub fn open_cached(
        design: &Design,
        layout: &Path,
        camera: &Camera,
        model: Option<&CalibratedModel>,
        scene: &SceneImage,
        cache: &KernelCache,
        progress: &dyn Progress,
    ) -> Result<Self> {
        Self::open_planned(
            KernelPlan::new(design, camera, scene)?,
            design,
            layout,
            model,
            cache,
            progress,
        )
    }

    /// Opens a system by the plan of a design.
    pub(crate) fn open_planned(
        plan: KernelPlan<'_>,
        design: &Design,
        layout: &Path,
        model: Option<&CalibratedModel>,
        cache: &KernelCache,
        progress: &dyn Progress,
    ) -> Result<Self> {
        progress.begin("reading the layout", 1);
        let digest = hex(&file_digest(layout)?);
        let inputs = plan.inputs(&digest, model)?;
        let SceneView {
            rows,
            columns,
            field_deg,
            ..
        } = plan.scene.view;
        let field = format!("{rows}x{columns} {field_deg}{}", arrival_inputs(plan.camera));
        let stray_light_inputs = [&inputs[..], field.as_bytes()].concat();
        let folder = cache.folder.as_deref();
        let bank = folder.and_then(|f| cache_file::cached_bank(f, &inputs));
        let stray_light = folder.and_then(|f| cache_file::cached_stray_light(f, &stray_light_inputs));
        let from_cache = [bank.is_some(), stray_light.is_some()];
        if let (
            KernelCache {
                folder: Some(folder),
                make: false,
                ..
            },
            [false, _] | [_, false],
        ) = (cache, from_cache)
        {
            return Err(Error::refused(
                "dataset/kernels-missing",
                format!("{} does not hold the kernels of this camera", folder.display()),
                "plan the set again; shards make no kernels",
            ));
        }
        let read = || {
            let extraction = read_pillars(design, layout, progress)?;
            check_elements(design, &extraction).map(|()| extraction)
        };
        let mut extraction = None;
        let count_inputs = format!("{digest} {}", design.digest()).into_bytes();
        let mut pillars = folder.and_then(|f| cache_file::cached_pillars(f, &count_inputs));
        if pillars.is_none() && cache.make {
            let count = PillarCount::of(design, extraction.insert(read()?), progress)?;
            let write = |folder: &Path| cache_file::cache_pillars(folder, &count_inputs, &count);
            cache.keep("the count of the pillars is", write, progress)?;
            pillars = Some(count);
        }
        let notes = pillars.as_ref().and_then(PillarCount::note);
        notes
            .into_iter()
            .chain(plan.notes())
            .for_each(|note| progress.warn(&note));
        let (bank, stray_light) = match (bank, stray_light) {
            (Some(bank), Some(stray_light)) => (bank, stray_light),
            (bank, _) => {
                let extraction = match extraction {
                    Some(extraction) => extraction,
                    None => read()?,
                };
                let models;
                let made;
                let case = if let Some(model) = model {
                    made = AsBuiltChip::in_light(&design.lit_stack()?, model)?.cached_in(cache_folder().as_deref());
                    SimulationCase::from(&made)
                } else {
                    models = cell_models(design, &[design.verify.fidelity])?;
                    models[0].as_ref().into()
                };
                let chip = plan.chip(&extraction, case, progress)?;
                let bank = if let Some(bank) = bank {
                    bank
                } else {
                    let parts = KernelParts::of(cache, &inputs, &plan.camera.name);
                    let bank = plan.bank(&chip, &parts, progress)?;
                    let write = |folder: &Path| {
                        cache_file::cache_bank(folder, &inputs, &bank)?;
                        parts.remove();
                        Ok(())
                    };
                    cache.keep("the kernels are", write, progress)?;
                    bank
                };
                let stray_light = plan.stray_light(&chip, &bank, progress)?;
                let write = |folder: &Path| cache_file::cache_stray_light(folder, &stray_light_inputs, &stray_light);
                cache.keep("the stray light is", write, progress)?;
                (bank, stray_light)
            }
        };
        Ok(Self {
            pillars,
            from_cache,
            ..plan.system(bank, stray_light)?
        })
    }

    /// Opens a system for pillars that were read and a case in memory, such as one of many draws of a chip: nothing is
    /// stored on the disk. `nodes`: places an axis of the field of each element at which kernels are formed, as many as
    /// for [`ImagingSystem::open`] if left out.
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
        let mut plan = KernelPlan::new(design, camera, scene)?;
        check_elements(design, extraction)?;
        if let Some(nodes) = nodes {
            plan = plan.with_nodes(nodes);
        }
        let chip = plan.chip(extraction, case, progress)?;
        let bank = plan.bank(&chip, &KernelParts::none(), progress)?;
        let stray_light = plan.stray_light(&chip, &bank, progress)?;
        plan.system(bank, stray_light)
    }
}
