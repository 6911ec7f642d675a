//! Models and the frames in which their parts are placed.
//!
//! A pose is given in the frame that `relative_to` names, or else in the frame of what it is part
//! of; the pose of an included model may be that of one of its frames (`placement_frame`). Names of
//! frames in models within models are joined by `::`.

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Isometry3, Matrix4, Quaternion, Translation3, UnitQuaternion};
use roxmltree::Node;

use super::super::placing::turn_rpy;
use super::super::{FormatError, xml};
use super::fault;
use super::geometry::Geometry;

/// Most frames of which each is given in the next one.
const CHAIN_MAX: usize = 64;

/// The name of the frame of the model that a name is in.
const MODEL_FRAME: &str = "__model__";

/// A pose as it is given.
#[derive(Clone, Default)]
struct Pose {
    given: Option<Isometry3<f64>>,
    /// The frame in which it is given; `None`: that of what it is part of.
    relative_to: Option<String>,
}

/// A model, or a world.
#[derive(Clone, Default)]
pub(super) struct Model {
    name: String,
    pose: Pose,
    placement_frame: Option<String>,
    frames: Vec<(String, Pose)>,
    pub(super) links: Vec<Link>,
    pub(super) models: Vec<Model>,
    names: OnceCell<Names>,
}

/// What the names in a model stand for; made when a pose first asks for one, after all is there.
#[derive(Clone, Default)]
struct Names {
    frames: BTreeMap<String, Named>,
    /// Places in the list of models.
    models: BTreeMap<String, usize>,
}

/// A frame, by its place in a list.
#[derive(Clone, Copy)]
enum Named {
    Frame(usize),
    Link(usize),
}

/// A link of a model.
#[derive(Clone)]
pub(super) struct Link {
    name: String,
    pose: Pose,
    shapes: Vec<Shape>,
}

/// A shape of a link.
#[derive(Clone)]
pub(super) struct Shape {
    pose: Pose,
    pub(super) geometry: Geometry,
}

/// What is done with a shape and the matrix that places it.
pub(super) type Visit<'a> = dyn FnMut(&Shape, &Matrix4<f64>) -> Result<(), FormatError> + 'a;

fn name_of(element: Node<'_, '_>) -> String {
    element.attribute("name").unwrap_or_default().to_owned()
}

impl Pose {
    /// The pose of an element.
    fn of(element: Node<'_, '_>) -> Result<Self, FormatError> {
        let Some(pose) = xml::child(element, "pose") else { return Ok(Self::default()) };
        let numbers = xml::numbers::<f64>(pose, 16)?;
        let is_finite = numbers.iter().all(|number| number.is_finite());
        let place = |numbers: &[f64]| Translation3::new(numbers[0], numbers[1], numbers[2]);
        let given = match (numbers.len(), pose.attribute("rotation_format")) {
            (0, _) => Isometry3::identity(),
            (6, None | Some("euler_rpy")) if is_finite => {
                let is_degrees = xml::is_true(pose, "degrees");
                let angle = |number: f64| if is_degrees { number.to_radians() } else { number };
                let turn = turn_rpy([numbers[3], numbers[4], numbers[5]].map(angle));
                Isometry3::from_parts(place(&numbers), turn)
            }
            (7, Some("quat_xyzw")) if is_finite => {
                let turn = Quaternion::new(numbers[6], numbers[3], numbers[4], numbers[5]);
                Isometry3::from_parts(place(&numbers), UnitQuaternion::from_quaternion(turn))
            }
            _ => return Err(xml::fault(pose, "expected x y z roll pitch yaw, or x y z qx qy qz qw of quat_xyzw")),
        };
        // Until version 1.6, the attribute was `frame`.
        let frame = pose.attribute("relative_to").or(pose.attribute("frame")).filter(|frame| !frame.is_empty());
        Ok(Self { given: Some(given), relative_to: frame.map(str::to_owned) })
    }

    /// The same pose, given in another frame unless it names one.
    fn or_relative_to(self, frame: Option<&str>) -> Self {
        Self { relative_to: self.relative_to.or(frame.filter(|frame| !frame.is_empty()).map(str::to_owned)), ..self }
    }
}

impl Model {
    /// A model without its links and the models in it.
    pub(super) fn of(element: Node<'_, '_>) -> Result<Self, FormatError> {
        let mut frames = Vec::new();
        for frame in xml::children(element, "frame") {
            frames.push((name_of(frame), Pose::of(frame)?.or_relative_to(frame.attribute("attached_to"))));
        }
        for joint in xml::children(element, "joint") {
            let child = xml::child(joint, "child").and_then(|child| child.text()).map(str::trim);
            frames.push((name_of(joint), Pose::of(joint)?.or_relative_to(child)));
        }
        Ok(Self {
            name: name_of(element),
            pose: Pose::of(element)?,
            placement_frame: element.attribute("placement_frame").map(str::to_owned),
            frames,
            ..Self::default()
        })
    }

    /// A world of models.
    pub(super) fn of_models(models: Vec<Self>) -> Self {
        Self { models, ..Self::default() }
    }

    /// Overrides what an include overrides.
    pub(super) fn include(&mut self, element: Node<'_, '_>) -> Result<(), FormatError> {
        let text = |name| xml::child(element, name).and_then(|child| child.text()).map(|text| text.trim().to_owned());
        if let Some(name) = text("name") {
            self.name = name;
        }
        let pose = Pose::of(element)?;
        if pose.given.is_some() {
            self.pose = pose;
        }
        if let Some(frame) = text("placement_frame").filter(|frame| !frame.is_empty()) {
            self.placement_frame = Some(frame);
        }
        Ok(())
    }

    /// Takes in the links, frames and models of an included model as its own, which stay where they
    /// are: what is given in the frame of that model is given in a frame that stands for it.
    pub(super) fn merge(&mut self, model: Self) -> Result<(), FormatError> {
        let stand_in = format!("_merged__{}__model__", model.name);
        let given = model.pose.given.unwrap_or_else(Isometry3::identity) * model.of_placement_frame(0)?.inverse();
        let here = Pose { given: Some(given), relative_to: model.pose.relative_to };
        let in_stand_in = |pose: Pose| {
            let frame = pose.relative_to.filter(|frame| frame != MODEL_FRAME).unwrap_or_else(|| stand_in.clone());
            Pose { given: pose.given, relative_to: Some(frame) }
        };
        let of_shape = |shape: Shape| {
            let relative_to = shape.pose.relative_to.as_deref();
            let pose = if relative_to == Some(MODEL_FRAME) { in_stand_in(shape.pose) } else { shape.pose };
            Shape { pose, ..shape }
        };
        self.frames.extend(model.frames.into_iter().map(|(name, pose)| (name, in_stand_in(pose))));
        self.links.extend(model.links.into_iter().map(|link| Link {
            pose: in_stand_in(link.pose),
            shapes: link.shapes.into_iter().map(of_shape).collect(),
            name: link.name,
        }));
        self.models.extend(model.models.into_iter().map(|part| Self { pose: in_stand_in(part.pose), ..part }));
        self.frames.push((stand_in, here));
        self.names = OnceCell::new();
        Ok(())
    }

    /// The model in it with a name.
    pub(super) fn model_mut(&mut self, name: &str) -> Option<&mut Self> {
        self.models.iter_mut().find(|model| model.name == name)
    }

    /// Moves the model to where an element has it in the world, `parent` being the frame that it is
    /// in; its frame in the world then. `None` if the element has no pose.
    pub(super) fn move_to(
        &mut self,
        element: Node<'_, '_>,
        parent: &Isometry3<f64>,
    ) -> Result<Option<Isometry3<f64>>, FormatError> {
        let Some(place) = Pose::of(element)?.given else { return Ok(None) };
        self.pose = Pose { given: Some(parent.inverse() * place), relative_to: None };
        self.placement_frame = None;
        Ok(Some(place))
    }

    /// Moves the link that an element names to where it has it in the world, `here` being the frame
    /// of this model.
    pub(super) fn move_link_to(&mut self, element: Node<'_, '_>, here: &Isometry3<f64>) -> Result<(), FormatError> {
        let link = self.links.iter_mut().find(|link| Some(link.name.as_str()) == element.attribute("name"));
        if let (Some(link), Some(place)) = (link, Pose::of(element)?.given) {
            link.pose = Pose { given: Some(here.inverse() * place), relative_to: None };
        }
        Ok(())
    }

    /// The number of models in it.
    pub(super) fn models_in(&self) -> usize {
        self.models.iter().map(|model| 1 + model.models_in()).sum()
    }

    /// Itself and the shapes of its own links.
    pub(super) fn own_parts(&self) -> usize {
        1 + self.links.iter().map(|link| 1 + link.shapes.len()).sum::<usize>()
    }

    /// The same with all models in it.
    pub(super) fn parts(&self) -> usize {
        self.own_parts() + self.models.iter().map(Self::parts).sum::<usize>()
    }

    /// Visits all shapes.
    pub(super) fn each_shape(&self, visit: &mut dyn FnMut(&Shape)) {
        self.links.iter().flat_map(|link| &link.shapes).for_each(&mut *visit);
        self.models.iter().for_each(|model| model.each_shape(visit));
    }

    /// Visits all shapes of a world, or of a model with its pose, with the matrices that place
    /// them.
    pub(super) fn place(&self, visit: &mut Visit<'_>) -> Result<(), FormatError> {
        let pose = self.pose.given.unwrap_or_else(Isometry3::identity);
        self.place_at(&(pose * self.of_placement_frame(0)?.inverse()), visit)
    }

    fn place_at(&self, here: &Isometry3<f64>, visit: &mut Visit<'_>) -> Result<(), FormatError> {
        for link in &self.links {
            let of_link = self.pose_of(&link.pose, None, 0)?;
            for shape in &link.shapes {
                let place = here * self.pose_of(&shape.pose, Some(&of_link), 0)?;
                visit(shape, &place.to_homogeneous())?;
            }
        }
        self.models.iter().try_for_each(|model| model.place_at(&(here * self.of_model(model, 0)?), visit))
    }

    /// The frame of a model in this one.
    fn of_model(&self, model: &Self, depth: usize) -> Result<Isometry3<f64>, FormatError> {
        Ok(self.pose_of(&model.pose, None, depth)? * model.of_placement_frame(depth)?.inverse())
    }

    fn of_placement_frame(&self, depth: usize) -> Result<Isometry3<f64>, FormatError> {
        self.placement_frame.as_ref().map_or(Ok(Isometry3::identity()), |frame| self.of_frame(frame, depth))
    }

    /// A pose in the frame of this model, given in the frame that it names, or in `parent`.
    fn pose_of(
        &self,
        pose: &Pose,
        parent: Option<&Isometry3<f64>>,
        depth: usize,
    ) -> Result<Isometry3<f64>, FormatError> {
        let base = match (&pose.relative_to, parent) {
            (Some(frame), _) => self.of_frame(frame, depth)?,
            (None, Some(parent)) => *parent,
            (None, None) => Isometry3::identity(),
        };
        Ok(base * pose.given.unwrap_or_else(Isometry3::identity))
    }

    /// What its names stand for; of equal ones, the first of the frames, or else of the links.
    fn names(&self) -> Names {
        let mut names = Names::default();
        let frames = self.frames.iter().enumerate().map(|(place, (name, _))| (name, Named::Frame(place)));
        let links = self.links.iter().enumerate().map(|(place, link)| (&link.name, Named::Link(place)));
        for (name, named) in frames.chain(links) {
            names.frames.entry(name.clone()).or_insert(named);
        }
        for (place, model) in self.models.iter().enumerate() {
            names.models.entry(model.name.clone()).or_insert(place);
        }
        names
    }

    /// The frame with this name in the frame of this model.
    fn of_frame(&self, name: &str, depth: usize) -> Result<Isometry3<f64>, FormatError> {
        if depth > CHAIN_MAX {
            return Err(fault(format_args!("frame {name:?}"), "frames are given relative to each other in a circle"));
        }
        let depth = depth + 1;
        if matches!(name, MODEL_FRAME | "world") {
            return Ok(Isometry3::identity());
        }
        let names = self.names.get_or_init(|| self.names());
        match names.frames.get(name) {
            Some(&Named::Frame(place)) => return self.pose_of(&self.frames[place].1, None, depth),
            Some(&Named::Link(place)) => return self.pose_of(&self.links[place].pose, None, depth),
            None => {}
        }
        let (first, rest) = name.split_once("::").map_or((name, None), |(first, rest)| (first, Some(rest)));
        let Some(model) = names.models.get(first).map(|&place| &self.models[place]) else {
            let place = format!("model {:?}", self.name);
            return Err(fault(place, format_args!("there is no frame {name:?} that a pose is relative to")));
        };
        let of_model = self.of_model(model, depth)?;
        Ok(of_model * rest.map_or(Ok(Isometry3::identity()), |rest| model.of_frame(rest, depth))?)
    }
}

impl Link {
    /// A link with its shapes, whose files start from `folder`.
    pub(super) fn of(element: Node<'_, '_>, folder: &Path) -> Result<Self, FormatError> {
        let shapes = |name| {
            let shapes = xml::children(element, name).map(|shape| Shape::of(shape, folder));
            shapes.filter_map(Result::transpose).collect::<Result<Vec<Shape>, FormatError>>()
        };
        let mut of_link = shapes("collision")?;
        if of_link.is_empty() {
            of_link = shapes("visual")?;
        }
        Ok(Self { name: name_of(element), pose: Pose::of(element)?, shapes: of_link })
    }
}

impl Shape {
    fn of(element: Node<'_, '_>, folder: &Path) -> Result<Option<Self>, FormatError> {
        let geometry = xml::child(element, "geometry").map(|geometry| Geometry::of(geometry, folder)).transpose()?;
        let pose = Pose::of(element)?;
        Ok(geometry.flatten().map(|geometry| Self { pose, geometry }))
    }
}
