"""The public names, and where they are defined."""

from .baking.bake import bake as bake
from .contact.body_pair import BodyPair as BodyPair
from .contact.deformable.elastic_body import ElasticBody as ElasticBody
from .contact.deformable.elastic_body import elastic_body as elastic_body
from .contact.deformable.elastic_body import tetrahedra_in as tetrahedra_in
from .contact.deformable.elastic_contact import ElasticContact as ElasticContact
from .contact.deformable.surface import DeformableSurface as DeformableSurface
from .contact.deformable.surface_contact import SurfaceContact as SurfaceContact
from .contact.multibody import MultibodySolver as MultibodySolver
from .contact.response.settings import ForceSettings as ForceSettings
from .contact.soft.skin import SoftSkin as SoftSkin
from .contact.soft.skin_contact import SkinContact as SkinContact
from .contact.solver import ContactSolver as ContactSolver
from .contact.taxel_forces import TaxelForces as TaxelForces
from .designing.design import design as design
from .dynamics.virtual_coupling.settings import CouplingSettings as CouplingSettings
from .errors import AsperityError as AsperityError
from .geometry.bodies import Body as Body
from .geometry.bodies import Geom as Geom
from .realtime.devices.catalogue import device as device
from .realtime.servo.running import Servo as Servo
from .runs.dataset import open_recording as open_recording
from .scene.builtin import load_scene as load_scene
from .scene.from_files import make_scene as make_scene
from .scene.scene import Scene as Scene
from .scene.trajectory import ScriptedMotion as ScriptedMotion
from .scene.trajectory import Trajectory as Trajectory
from .scene.trajectory_file import read_poses as read_poses
from .simulation.simulation import Simulation as Simulation
from .studies.sweeps.function_runs import sweep as sweep
from .texture.files.reading import read_heights as read_heights
from .texture.friction_map import FrictionMap as FrictionMap
from .texture.height_field import HeightField as HeightField
from .texture.stiffness_map import StiffnessMap as StiffnessMap

__version__: str
