from quasilpv.artifact import Artifact as Artifact
from quasilpv.chain import design as design
from quasilpv.chain import gate as gate
from quasilpv.chain import robot as robot
from quasilpv.chain import simulate as simulate
from quasilpv.chain import verify as verify
from quasilpv.errors import InputError as InputError
from quasilpv.exchange import export as export
from quasilpv.exchange import state_space as state_space
from quasilpv.figures.region import plot_region as plot_region
from quasilpv.studies.answer import Answer as Answer
from quasilpv.studies.answer import Evidence as Evidence
from quasilpv.studies.answer import Verdict as Verdict
from quasilpv.studies.front_door import boundary as boundary
from quasilpv.studies.front_door import region as region
from quasilpv.studies.front_door import solve as solve
from quasilpv.studies.law import Law as Law
from quasilpv.system_chain import controller as controller
from quasilpv.system_chain import stabilise as stabilise
from quasilpv.systems.descriptor.names import rate as rate
from quasilpv.systems.descriptor.structure import structure_report as structure_report
from quasilpv.systems.descriptor.system import DescriptorSystem as DescriptorSystem

__version__: str
