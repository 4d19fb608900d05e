//! The virtual rig: a simulated gantry, projector and camera round a virtual scene, as imperfect as asked for.
//!
//! What the camera sees is computed once a position, for all squares together ([`relumine_tracer::Paths`]); a photograph is
//! the sum of the lit squares with the projector's black, through the sensor. All random numbers follow from the seed and
//! from what is photographed, so a photograph taken again is the same to the bit.

mod sensor;
mod settings;
mod world;

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use relumine_basis::Position;
use relumine_capture::{CameraResponse, Setup, ShownPattern};
use relumine_radiometry::ExposureSettings;
use relumine_radiometry::files::encode_png_counts;
use relumine_tracer::{PathOptions, Scene};

use crate::{Camera, Drivers, Photograph, Projector, RigError, Stage};
use sensor::Sensor;
pub use settings::{SensorText, SimulatedText};
use world::World;

/// Reads the scene and makes the virtual rig ready. What it photographs it can photograph again, so nothing is durable.
///
/// # Errors
/// If the scene cannot be read, or a setting cannot be.
pub fn open(settings: &SimulatedText, setup: Arc<Setup>) -> Result<Drivers, RigError> {
    let fail = |reason: String| RigError::Device { device: "simulated rig", reason };
    for (name, value, most) in [
        ("projector_black", settings.projector_black, 0.5),
        ("projector_vignetting", settings.projector_vignetting, 0.99),
        ("misplaced_deg", settings.misplaced_deg, 45.0),
    ] {
        if !(0.0..=most).contains(&value) {
            return Err(fail(format!("{name} must be 0 to {most}, but is {value}")));
        }
    }
    for (name, value, most) in [("samples", settings.samples, 1 << 20), ("bounces", settings.bounces, 1 << 10)] {
        if !(1..=most).contains(&value) {
            return Err(fail(format!("{name} must be 1 to {most}, but is {value}")));
        }
    }
    let CameraResponse::Known(response) = setup.response().clone() else {
        return Err(fail("a simulated camera has the response it is given; \"recover\" names none".into()));
    };
    let sensor = Sensor::new(settings.sensor, response, setup.levels(), settings.seed).map_err(fail)?;
    let (width, height) = setup.picture_size();
    let scene = Scene::read(&settings.scene)?.with_picture_size(width, height);
    let options = PathOptions { samples: settings.samples, bounces: settings.bounces, seed: settings.seed };
    let world = Rc::new(RefCell::new(World::new(scene, setup, settings.clone(), options)));
    Ok(Drivers {
        stage: Box::new(Simulated(world.clone())),
        projector: Box::new(Simulated(world.clone())),
        camera: Box::new(SimulatedCamera { world, sensor }),
        durable: false,
    })
}

/// The stage and the projector of a virtual rig.
struct Simulated(Rc<RefCell<World>>);

impl Stage for Simulated {
    fn move_to(&mut self, index: usize, position: Position) -> Result<(), RigError> {
        self.0.borrow_mut().move_to(index, position);
        Ok(())
    }
}

impl Projector for Simulated {
    fn show(&mut self, pattern: ShownPattern) -> Result<(), RigError> {
        self.0.borrow_mut().show(pattern);
        Ok(())
    }
}

struct SimulatedCamera {
    world: Rc<RefCell<World>>,
    sensor: Sensor,
}

impl Camera for SimulatedCamera {
    fn photograph(&mut self, exposure: &ExposureSettings) -> Result<Photograph, RigError> {
        let mut world = self.world.borrow_mut();
        let Some((place, radiance)) = world.radiance() else {
            let reason = "there is nothing to photograph before the stage has moved and the projector shown something";
            return Err(RigError::Device { device: "simulated camera", reason: reason.into() });
        };
        let counts = self.sensor.counts(&radiance, exposure, &place);
        Ok(Photograph { bytes: encode_png_counts(&counts, self.sensor.bits()), extension: "png".into() })
    }
}
