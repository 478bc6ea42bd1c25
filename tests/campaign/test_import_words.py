"""What imports and status say of modes, of one thing found twice, of replaced files."""

from dataclasses import replace
from types import SimpleNamespace
from xml.etree import ElementTree

import msgspec
import numpy as np
import pytest

from planner.campaign.events import HitRecord
from planner.campaign.import_checks import unexpected_modes
from planner.campaign.model import Model
from planner.campaign.state import Measurement
from planner.effects.resonator import LinkResonator
from planner.robot.arm_chain import arm_chain


def modes(*hertz: float):
    return tuple(SimpleNamespace(frequency_hz=f, frequency_sd_hz=0.003, likely=True) for f in hertz)


@pytest.mark.parametrize(("found", "said"), [(14.66, 0), (9.99, 1)])
def test_a_mode_far_from_where_it_was_expected_is_said(found, said):
    expected = np.array([[9.23, 14.65]]), np.array([[0.02, 0.06]])
    before = SimpleNamespace(labelled=("P001",), frequencies=lambda q: expected)
    sure, own = np.ones(2), modes(9.24, found)
    here = SimpleNamespace(pose="P002", q=np.zeros(6), modes=own, probability=sure)
    told = unexpected_modes(before, SimpleNamespace(labelled=(here,)), "P002")
    assert len(told) == said
    assert all("mode 2 at 9.99 Hz, expected at 14.650 ± 0.060 Hz (78 sd off)" in t for t in told)
    assert not unexpected_modes(SimpleNamespace(labelled=()), SimpleNamespace(labelled=()), "P002")


def test_modes_beside_those_predicted_are_said_where_every_pose_shows_them():
    table = SimpleNamespace(modes=SimpleNamespace(count=2))
    poses = [SimpleNamespace(modes=modes(9.0, 14.0)), SimpleNamespace(modes=modes(9.1, 14.1))]
    used = [SimpleNamespace(modes=modes(9.0, 14.0, 29.0)), SimpleNamespace(modes=poses[1].modes)]
    model = SimpleNamespace(labelled=poses, used=used, cell=SimpleNamespace(config=table))
    assert Model.not_predicted.fget(model) == ""
    used[1].modes = modes(9.1, 14.1, 32.0)
    assert "between 29.0 and 32.0 Hz" in Model.not_predicted.fget(model)


def test_refused_files_that_were_replaced_are_none_any_more():
    bad = HitRecord("first/x_1.csv", "a" * 64, ".csv", accepted=False, reason="no hit axis")
    good = HitRecord("again/x_1.csv", "b" * 64, ".csv", "+x")
    other = msgspec.structs.replace(bad, file="first/y_1.csv")
    along = msgspec.structs.replace(bad, hit="+y")  # of the same name in another folder
    measured = Measurement("P1", (0.0,), (bad, good, other, along), ())
    assert measured.refused == (other, along)
    assert replace(measured, hits=(bad, other)).refused == (bad, other)


def swinging(mass: float, hertz: float, *way: float):
    values = {"mass": (mass, 0.4), "frequency": (hertz, 0.01)}
    return values | {f"direction_{a}": (w, 0.1) for a, w in zip("xyz", way, strict=True)}


def test_one_mass_that_swings_in_three_directions_is_told_once():
    hose = LinkResonator("link_3", joint="joint_3")
    x, y, z = (
        swinging(12.1, 14.0, 1, 0, 0.1),
        swinging(12.4, 14.0, 0, 1, 0),
        swinging(11.8, 16, 0, 0, 1),
    )
    assert hose.same_thing(x, y)
    assert hose.same_thing(x, z)
    assert not hose.same_thing(x, swinging(4.0, 14.0, 0, 1, 0))
    assert not hose.same_thing(x, swinging(12.1, 30.0, 1, 0.2, 0))
    told = hose.words_together([y, x, z])
    assert "Something of 12 kg on link_3 swings on its own at" in told
    assert "14.0 Hz along x and y and 16.0 Hz along z" in told


@pytest.mark.parametrize(("name", "sensor"), [("sensor", "sensor"), ("cover", "tcp")])
def test_a_link_called_sensor_is_where_the_sensor_is(name, sensor):
    joint = '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/></joint>'
    limit = '<joint name="joint_1" type="revolute"><parent link="base"/><child link="link_1"/>'
    limit += '<limit lower="-1" upper="1"/></joint>'
    fixed = joint.format("a", "fixed", "link_1", "tcp") + joint.format("b", "fixed", "tcp", name)
    links = "".join(f'<link name="{link}"/>' for link in ("base", "link_1", "tcp", name))
    chain = arm_chain(ElementTree.fromstring(f"<robot>{links}{limit}{fixed}</robot>"))
    assert chain is not None
    assert (chain.tcp, chain.sensor) == ("tcp", sensor)
