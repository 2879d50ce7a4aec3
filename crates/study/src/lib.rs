//! Studies: a chip made many times with the tolerances of a process and a bench, cut into shards.
//!
//! ```text
//! tolerance.toml         ->  Tolerance
//! design, layout, cells  ->  Plan: a folder with manifest, layout and tables of cells
//! plan, number of shard  ->  a file of draws, whole or not at all
//! all shards             ->  StudyResult: draws, yields, shares of variance, page
//! ```
//!
//! Draw `k` follows from the plan and `k` alone: neither the size of a shard, nor the order in which shards run, nor the
//! machine or the number of threads change it.
//!
//! | file | holds |
//! | --- | --- |
//! | `study_file` | the file of a study, and its quantities as effects of the calibration |
//! | `designs` | keys of the design that vary over a grid |
//! | `draw` | the numbers of one draw |
//! | `bias` | whether pillars can be as all draws make them |
//! | `bench` | what draws are judged with: designs, layouts as read back, tables of cells |
//! | `picture` | the picture that each draw takes |
//! | `record` | what is kept of one draw |
//! | `plan`, `shard` | the folder of a study |
//! | `pairs`, `comparison`, `starts` | pairs for learning, cameras side by side, starts of the optimiser, in shards |
//! | `sharding`, `manifest`, `work` | shards of whatever work |
//! | `shard_file`, `status` | one shard as a file with its digest, and the state of all |
//! | `merge`, `yields`, `response`, `grid_points` | all draws, and what they say |
//! | `columns`, `parquet_file` | the draws as a table |
//! | `page`, `grid_page` | what a person reads |
//! | `slurm`, `shell` | job arrays, and paths as words of a shell |

mod bench;
mod bias;
mod columns;
#[cfg(feature = "baselines")]
mod comparison;
mod designs;
mod draw;
mod grid_page;
mod grid_points;
mod manifest;
mod merge;
mod page;
mod pairs;
#[cfg(feature = "parquet")]
mod parquet_file;
mod picture;
mod plan;
mod record;
mod response;
mod shard;
mod shard_file;
mod sharding;
mod shell;
mod slurm;
mod starts;
mod status;
mod study_file;
mod work;
mod yields;

pub use bench::JudgedDraw;
#[cfg(feature = "baselines")]
pub use comparison::{ComparisonPlan, plan_comparison};
pub use designs::DesignGrid;
pub use draw::Drawn;
pub use grid_points::{GridPoint, Spread};
pub use manifest::{MANIFEST, is_planned};
pub use merge::{StudyResult, TableFormat, merge};
pub use page::{report_files, write_page};
pub use pairs::{PairsPlan, PairsRequest, plan_pairs};
pub use picture::{KnownKernels, PictureSpec, SceneChoice, TakenPicture};
pub use plan::{Layout, PillarPlace, Plan, PlanSettings, plan, planned_later};
pub use record::{DrawRecord, LimitStatement};
pub use response::{Response, Tightening};
pub use shard::Run;
pub use sharding::{FilesOfPart, Shard, Sharding};
pub use slurm::{JOB_NAME, Job, Queued, Slurm, queued_shards, submitted};
pub use starts::{StartRecord, StartsPlan, StartsResult, plan_starts};
pub use status::Status;
pub use study_file::{Distribution, FigureLimit, Grid, Tolerance, Varied};
pub use work::Work;
pub use yields::{Yield, wilson};
