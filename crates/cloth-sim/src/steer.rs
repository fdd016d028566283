//! Pins that are moved while the simulation goes on, as a gripper is: by what has been seen so far.

use crate::motion::Path;
use crate::pins::PinSet;
use crate::scene::{Keyframe, Rotation};
use crate::step::State;
use crate::{SimError, Simulation};

impl Simulation {
    /// Has pin number `pin` of cloth number `cloth` go from where it is to a pose, reached `seconds` \[s\] from now, and stay there.
    ///
    /// `position` is the displacement from the scene's start \[m\], `rotation` is about the pin's pivot, both as in a keyframe. In
    /// between, the motion is that between two keyframes. What the pin was to do later is dropped. The keyframes become the
    /// scene's, so that a checkpoint resumes to the same bits.
    ///
    /// # Errors
    /// [`SimError::InvalidArgument`] for a cloth or pin that there is not, a pin that a collider carries, a time that is not finite and
    /// positive, or while an interrupted [`Simulation::advance`] has something left; [`SimError::InvalidScene`] for a pose that a
    /// keyframe may not have. Nothing has changed then.
    pub fn steer(
        &mut self,
        cloth: usize,
        pin: usize,
        position: [f64; 3],
        rotation: Option<Rotation>,
        seconds: f64,
    ) -> Result<(), SimError> {
        let bad = |name, expected, got: String| Err(SimError::InvalidArgument { name, expected, got });
        if self.is_interrupted() {
            return bad(
                "seconds",
                "no interrupted advance: finish_advance does the rest",
                format!("{seconds}"),
            );
        }
        if !(seconds.is_finite() && seconds > 0.0) {
            return bad("seconds", "a finite number > 0 [s]", format!("{seconds}"));
        }
        let mut scene = self.scene.clone();
        let Some(pins) = scene.cloth.get_mut(cloth).map(|cloth| &mut cloth.pins) else {
            return bad("cloth", "a cloth of the scene", format!("{cloth} of {}", self.scene.cloth.len()));
        };
        let count = pins.len();
        let Some(pin) = pins.get_mut(pin) else {
            return bad("pin", "a pin of the cloth", format!("{pin} of {count}"));
        };
        if let Some(collider) = &pin.collider {
            return bad("pin", "a pin that no collider carries", format!("one on \"{collider}\""));
        }
        let now = self.state.time;
        let begin = here(&pin.keyframes, now);
        pin.keyframes = vec![begin, Keyframe { time: now + seconds, position: Some(position), rotation }];
        scene.check()?;
        let start = State::start(&self.bodies);
        self.pins = PinSet::new(&scene, &self.bodies, &start.x)?;
        self.scene = scene;
        Ok(())
    }
}

/// The pose now, as a keyframe.
fn here(keyframes: &[Keyframe], now: f64) -> Keyframe {
    match keyframes.last() {
        None => Keyframe { time: now, position: None, rotation: None },
        Some(last) if last.time <= now => Keyframe { time: now, ..*last },
        Some(_) => {
            let pose = Path::new(keyframes, [0.0; 3], None).at(now);
            let rotation = pose.rotation.axis_angle();
            Keyframe {
                time: now,
                position: Some(pose.translation.vector.into()),
                rotation: rotation.map(|(axis, angle)| Rotation { axis: axis.into_inner().into(), angle }),
            }
        }
    }
}
