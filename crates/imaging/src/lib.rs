//! The picture that the camera of a layout takes, and the picture restored from it.
//!
//! ```text
//! layout as read, camera       ->  ChipInLight
//! spectra of a scene           ->  KernelBank: images of a point over the field; StrayLight: all other light
//! both, and a view             ->  FrameOperator: planes of the scene to the frame, and its adjoint
//! ```

mod acceptance;
mod approximation_scores;
mod approximation_set;
mod cache_file;
mod chip;
mod colour;
mod dataset;
mod directional_cells;
mod element_images;
mod exposure;
mod field_of_view;
mod files;
mod forecast;
mod forecast_scene;
mod geometry;
mod image_check;
mod imaging_system;
mod kernel_cache;
mod kernel_parts;
mod kernel_plan;
mod kernels;
mod layout;
mod light_statement;
mod open_system;
mod operator;
mod operator_error;
mod page;
mod png16;
mod point_image;
mod recorded_frame;
mod report;
mod resolution;
mod restored_page;
pub mod scene;
mod score;
pub mod spectra;
mod steep_light;
mod stray_light;
mod thumbnail;
mod uncertainty;

pub use approximation_scores::{AssumedScore, without_dispersion, worth_of_assumptions};
pub use approximation_set::ApproximationSet;
pub use chip::{ChipInLight, ElementInLight, element_views, sampling_of, sensor_um};
pub use colour::ChannelColours;
pub use dataset::{
    DatasetManifest, DatasetOrigin, DatasetPair, PairWriter, check_pairs_apart, write_dataset, write_dataset_manifest,
};
pub use element_images::ElementImage;
pub use exposure::{ChosenExposure, Frame, channel_at, counts_channel, expose};
pub use files::{FrameFile, picture_file};
pub use forecast::{Forecast, NaturalForecast, NaturalScenes, Sampling, ScenePower};
pub use forecast_scene::ForecastScene;
pub use geometry::{ElementView, SceneSpace, SceneView};
pub use image_check::check_images;
pub use imaging_system::ImagingSystem;
pub use kernel_cache::KernelCache;
pub use kernel_plan::simulated_view;
pub use kernels::{BankSpec, KernelBank};
pub use layout::PillarCount;
pub use light_statement::{LightStatement, WhitePixel};
pub use operator::{BetweenNodes, Detail, FrameOperator, SceneInputs, ScenePoints};
pub use operator_error::OperatorError;
pub use page::{PicturePages, pictures_side_by_side, shown, write_pages};
pub use png16::write_picture;
pub use point_image::PointImage;
pub use recorded_frame::{FrameNumbers, is_simulated, read_signals};
pub use report::{
    Assumption, ChannelBudget, FrameStatement, HomographyResidual, PictureReport, RestorationReport, no_gain,
};
pub use resolution::{ContrastCurve, contrast_curves};
pub use restored_page::{RestoredPicture, RestoredReport};
pub use scene::SCORED_SIDES;
pub use score::{MOST_DB, Zone, ZoneScore, check_scored, psnr_words, scores};
pub use stray_light::{LightShares, StrayLight};
pub use thumbnail::thumbnail;
pub use uncertainty::{Uncertainty, UncertaintyReport};
