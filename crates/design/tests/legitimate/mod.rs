//! Reasons for wrong values of which nothing is said before a file is written.

/// What catches wrong values or why they are legitimate, and the values: key and factor.
pub(crate) const LEGITIMATE: &str = r"
legitimate: the hyperbola follows, and a lens may have any NA that its lattice carries | lens.focal_length_um x 10
legitimate: a number names a layer, two purposes on one are refused | layers.pillars.layer / 10, layers.pillar_marks.layer x 10, layers.pillar_marks.layer / 10, layers.apertures.layer x 10, layers.apertures.layer / 10
legitimate: a number names a layer, two purposes on one are refused | layers.aperture_marks.layer x 10, layers.aperture_marks.layer / 10, layers.outline.layer x 10, layers.label.layer x 10
legitimate: the opening still holds all pillars | apertures.margin_um / 10
legitimate: the polygon still holds the circle, and the margin is larger than the error | apertures.chord_error_nm x 10
legitimate: room around the elements | chip.size_um x 10
legitimate: other field angles | verify.field_x_deg / 10
legitimate: a larger window, at the cost of time | verify.window_samples x 10
legitimate: another sensor; reports state the pixel | verify.pixel_um x 10, verify.pixel_um / 10
legitimate: a stricter limit | verify.limits.mapping_phase_rms_max_rad / 10
legitimate: a limit is the choice of a designer, and the verdict states it | verify.limits.strehl_ratio_min / 10, verify.limits.strehl_min / 10, verify.limits.centroid_shift_max_um x 10, verify.limits.centroid_shift_max_um / 10
legitimate: a limit is the choice of a designer, and the verdict states it | verify.limits.mtf_difference_max x 10, verify.limits.mtf_difference_max / 10, verify.limits.psf_difference_max x 10
legitimate: a limit is the choice of a designer, and the verdict states it | verify.limits.psf_difference_max / 10, verify.limits.polychromatic_mtf_min x 10, verify.limits.polychromatic_mtf_min / 10
legitimate: a limit is the choice of a designer, and the verdict states it | verify.limits.polychromatic_mtf_lp_mm x 10, verify.limits.polychromatic_mtf_lp_mm / 10, verify.limits.polychromatic_energy_2_pixels_min x 10
legitimate: a limit is the choice of a designer, and the verdict states it | verify.limits.polychromatic_energy_2_pixels_min / 10, verify.limits.rounding_phase_rms_max_rad x 10
legitimate: a limit is the choice of a designer, and the verdict states it | verify.limits.rounding_phase_rms_max_rad / 10
limit, rounding_phase_rms_max_rad: steps of 10 degrees are 0.1 rad rms | cell.rotation_step_deg x 10
legitimate: at most 0.02 rad of phase, stated on the page of `run` | mapping.rotation_sines_deg x 10, mapping.rotation_sines_deg / 10
legitimate: at most 0.04 rad of phase, stated on the page of `run` | mapping.rotation_cosines_deg x 10, mapping.rotation_cosines_deg / 10
legitimate: a focus may be anywhere; figures are for the target phase | phase.term.centre_um / 10, phase.y.term.centre_um x 10, phase.y.term.centre_um / 10
legitimate: newer readers take 8191 vertices | apertures.max_vertices x 10
legitimate: a smaller cross | mark.length_um / 10
legitimate: a wider cross | mark.width_um x 10
legitimate: the elements still do not overlap | element.x_um / 10, element.y_um / 10
legitimate: an angle | element.rotation_deg x 10, element.rotation_deg / 10
legitimate: a polygon of more sides | element.aperture_sides x 10
legitimate: the hyperbola follows, and the page of `run` states it | element.focal_length_um x 10
legitimate: another polynomial | element.phase.term.powers_x x 10, element.phase.term.powers_x / 10, element.phase.term.powers_y x 10, element.phase.term.powers_y / 10
legitimate: a weaker polynomial | element.phase.term.coefficients_rad / 10
legitimate: the cross still meets no opening, which is refused | mark.x_um / 10, mark.y_um / 10
legitimate: an aberration may have any size | phase.term.coefficients_waves / 10
legitimate: a term may have any size | phase.term.scale / 10
legitimate: a number names a layer, two purposes on one are refused | layers.pillars.datatype x 10, layers.pillars.datatype / 10, layers.pillar_marks.datatype x 10, layers.pillar_marks.datatype / 10, layers.apertures.datatype x 10, layers.apertures.datatype / 10
legitimate: a number names a layer, two purposes on one are refused | layers.aperture_marks.datatype x 10, layers.aperture_marks.datatype / 10, layers.outline.datatype x 10, layers.outline.datatype / 10, layers.label.datatype x 10, layers.label.datatype / 10
legitimate: a limit is the choice of a designer, and the verdict states it | verify.limits.wrong_widths_max x 10, verify.limits.wrong_widths_max / 10, verify.limits.foreign_shapes_max x 10, verify.limits.foreign_shapes_max / 10
legitimate: another seed | optimise.seed x 10, optimise.seed / 10
legitimate: a longer or shorter search; its page shows whether it still gains | optimise.chains x 10, optimise.hot_sweeps x 10, optimise.hot_sweeps / 10, optimise.temperature x 10, optimise.temperature / 10
legitimate: a longer or shorter search; its page shows whether it still gains | optimise.blocks x 10, optimise.blocks / 10, optimise.steps x 10, optimise.steps / 10, optimise.rate_waves x 10, optimise.rate_waves / 10
legitimate: more or fewer wavelengths; the phase that is found is judged between them | optimise.step_nm x 10, optimise.views.step_nm / 10
legitimate: a stricter limit | optimise.step_limit_waves / 10
legitimate: a bound; kernels that do not fit are refused | optimise.memory_mb x 10, optimise.memory_mb / 10
legitimate: weights of merits are the choice of a designer | optimise.merit.sum x 10, optimise.merit.sum / 10, optimise.merit.log x 10, optimise.merit.log / 10, optimise.merit.side_lobes x 10, optimise.merit.side_lobes / 10
legitimate: weights of merits are the choice of a designer | optimise.merit.deconvolution x 10, optimise.merit.deconvolution / 10
legitimate: the size of a side lobe is the choice of a designer | optimise.merit.side_lobe_radius_um / 10
legitimate: a better or worse process; the page states it | optimise.robust.width_bias_nm / 10, optimise.robust.height_percent x 10, optimise.robust.height_percent / 10, optimise.robust.defocus_um / 10
legitimate: more or fewer draws | optimise.robust.draws x 10, optimise.robust.draws / 10
legitimate: other viewing angles | optimise.views.angles_deg / 10
legitimate: a smaller or larger window | optimise.views.pixels / 10
legitimate: a weight of images | optimise.views.shared_filter / 10
legitimate: more or fewer draws | optimise.views.drawn x 10
";
