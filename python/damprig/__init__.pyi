from .errors import DamprigError as DamprigError
from .errors import FaultError as FaultError
from .errors import InputError as InputError
from .errors import InternalError as InternalError
from .errors import RigError as RigError
from .errors import RunFolderError as RunFolderError
from .errors import RunFolderWarning as RunFolderWarning
from .errors import UnusualValueWarning as UnusualValueWarning
from .rig import Signals as Signals
from .rig import VirtualRig as VirtualRig
from .runs import Run as Run
from .runs import open_run as open_run
from .signals import read_signals as read_signals
from .signals import response_spectrum as response_spectrum
from .simulation import Simulation as Simulation
from .simulation import analyse as analyse
from .simulation import simulate as simulate
from .studies import Study as Study
from .studies import bifurcation as bifurcation
from .studies import continuation as continuation
from .studies import evaluate as evaluate
from .studies import optimise as optimise
from .studies import study as study
from .tables import Table as Table

__version__: str
