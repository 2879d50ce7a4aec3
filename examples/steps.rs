//! Experiment.
use metalith::camera::Camera;
use metalith::picture::restore::RestorationMethod;
use metalith::picture::scene::{SceneFile, read_scene};
use metalith::picture::{Rehearsal, Studio, scores};
use metalith::{Design, Result, Silent};

fn cpu() -> f64 {
    let s = std::fs::read_to_string("/proc/self/stat").unwrap();
    let f: Vec<&str> = s.rsplit(')').next().unwrap().split_whitespace().collect();
    (f[11].parse::<f64>().unwrap() + f[12].parse::<f64>().unwrap()) / 100.0
}

fn main() -> Result<()> {
    let a: Vec<String> = std::env::args().skip(1).collect();
    let design = Design::read(a[0].as_ref())?;
    let camera = Camera::read(a[2].as_ref())?;
    let scenes: Vec<_> = a[3]
        .split(',')
        .map(|p| {
            read_scene(&SceneFile {
                path: p.into(),
                wavelengths_nm: None,
                field_deg: a[4].parse().unwrap(),
                distance_um: f64::INFINITY,
            })
        })
        .collect::<Result<_>>()?;
    let studio = Studio::open(&design, a[1].as_ref(), &camera, None, &scenes[0], &Silent)?;
    let (simulation, operator) = (studio.simulation(), studio.restoration());
    let t = cpu();
    let rehearsal = Rehearsal::new(&studio, &operator);
    eprintln!("rehearsal {:.1}", cpu() - t);
    for scene in &scenes {
        let frame = studio.record(&simulation, scene, 1)?;
        let truth = studio.truth(scene);
        for n in a[5].split(',') {
            std::fs::write("/tmp/steps.cfg", n).unwrap();
            let t = cpu();
            let picture = studio.restore(
                &operator,
                &rehearsal.operator_error,
                &frame,
                RestorationMethod::Tikhonov,
                true,
                &Silent,
            )?;
            let s = scores(&picture, &truth)?;
            println!(
                "{} {n}: {}  lin {}  {:.1} s",
                scene.name,
                s.iter()
                    .map(|z| format!("{:.2}", z.psnr_db))
                    .collect::<Vec<_>>()
                    .join(" "),
                s.iter()
                    .map(|z| format!("{:.2}", z.psnr_linear_db))
                    .collect::<Vec<_>>()
                    .join(" "),
                cpu() - t
            );
        }
    }
    Ok(())
}
