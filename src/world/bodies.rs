//! The vessels as rapier sees them.
//!
//! Bodies are kinematic and position-based, with the hull as a solid collider and the collision
//! circle as a sensor. Nothing pushes a vessel: what rapier contributes is its broad and narrow phase
//! over all of them, so that its verdict on who overlaps at the end of a step stands beside the swept
//! queries within it. (Its full step would report the overlaps of the step before.)

use std::fmt;

use rapier2d_f64::prelude::{
    ActiveCollisionTypes, ColliderBuilder, ColliderHandle, Group, InteractionGroups, InteractionTestMode,
    PhysicsWorld, Pose as RapierPose, RigidBodyBuilder, RigidBodyHandle, Vector,
};

use super::{Pose, VesselBody};

const HULLS: Group = Group::GROUP_1;
const CIRCLES: Group = Group::GROUP_2;

/// What overlaps at the end of a step, as rapier's narrow phase sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Overlap {
    /// The collision circles.
    pub circles: bool,
    /// The hulls.
    pub hulls: bool,
}

#[derive(Debug, Clone, Copy)]
struct Handles {
    body: RigidBodyHandle,
    hull: ColliderHandle,
    circle: ColliderHandle,
}

/// The rapier world and the handles of every vessel in it.
pub(super) struct Bodies {
    physics: PhysicsWorld,
    handles: Vec<Handles>,
}

impl fmt::Debug for Bodies {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Bodies").field("handles", &self.handles).finish_non_exhaustive()
    }
}

impl Bodies {
    pub fn new() -> Self {
        Self { physics: PhysicsWorld::new(), handles: Vec::new() }
    }

    pub fn add(&mut self, body: &VesselBody, pose: Pose) {
        let corners = body.hull.outline.iter().map(|corner| Vector::new(corner.x, corner.y)).collect();
        let hull = ColliderBuilder::convex_polyline(corners).expect("a hull is convex and has an area");
        let circle = ColliderBuilder::ball(body.collision_radius_m).sensor(true);
        let rigid = RigidBodyBuilder::kinematic_position_based().pose(rapier_pose(pose));
        let rigid = self.physics.insert_body(rigid);
        let mut attach = |collider: ColliderBuilder, group: Group| {
            let collider = collider
                .active_collision_types(ActiveCollisionTypes::all())
                .collision_groups(InteractionGroups::new(group, group, InteractionTestMode::And));
            self.physics.insert_collider(collider, Some(rigid))
        };
        let (hull, circle) = (attach(hull, HULLS), attach(circle, CIRCLES));
        self.handles.push(Handles { body: rigid, hull, circle });
    }

    /// Puts a vessel where it is at the end of the step.
    pub fn put(&mut self, index: usize, pose: Pose) {
        let body = self.handles[index].body;
        self.physics.bodies[body].set_position(rapier_pose(pose), false);
    }

    /// Finds out who overlaps now.
    pub fn detect(&mut self) {
        self.physics.detect_collisions(&(), &());
    }

    pub fn overlap(&self, a: usize, b: usize) -> Overlap {
        let (a, b) = (self.handles[a], self.handles[b]);
        let narrow = &self.physics.narrow_phase;
        Overlap {
            circles: narrow.intersection_pair(a.circle, b.circle) == Some(true),
            hulls: narrow.contact_pair(a.hull, b.hull).is_some_and(|pair| {
                pair.manifolds().iter().flat_map(|manifold| &manifold.points).any(|point| point.dist <= 0.0)
            }),
        }
    }
}

fn rapier_pose(pose: Pose) -> RapierPose {
    RapierPose::new(Vector::new(pose.centre.x, pose.centre.y), pose.angle_rad)
}
