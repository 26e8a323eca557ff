"""The device in a plan of Bluesky."""

import bluesky
import pytest
from bluesky import plans
from bluesky.protocols import Movable, Readable, Triggerable

import damprig
from damprig.bluesky import FrequencyResponse


@pytest.fixture
def device(damped):
    rig = damprig.VirtualRig()
    rig.mount(damped)
    return FrequencyResponse(rig, name="rig", dwell_s=4.0, settle_s=1.0)


def test_the_device_has_the_protocols(device):
    assert all(isinstance(device, protocol) for protocol in (Movable, Readable, Triggerable))
    assert set(device.read()) == set(device.describe())


def test_a_scan_records_what_the_rig_measures(device, damped):
    documents = []
    engine = bluesky.RunEngine(call_returns_result=True)
    outcome = engine(plans.scan([device], device, 2.2, 2.8, 4), lambda name, document: documents.append((name, document)))
    assert outcome.exit_status == "success"
    data = [document["data"] for name, document in documents if name == "event"]
    rig = damprig.VirtualRig()
    rig.mount(damped)
    assert [row["rig"] for row in data] == pytest.approx([2.2, 2.4, 2.6, 2.8])
    for row in data:
        assert row["rig_x_over_z"] == rig.measure(row["rig"], dwell_s=4.0, settle_s=1.0)["x_over_z"]
    keys = next(document for name, document in documents if name == "descriptor")["data_keys"]
    assert keys["rig"]["units"] == "Hz" and keys["rig_phase_rad"]["units"] == "rad"


def test_a_refused_measurement_fails_its_status(device):
    device.set(-2.5)
    status = device.trigger()
    with pytest.raises(damprig.InputError, match="frequencies_hz"):
        status.wait(60)
    assert status.done and not status.success
