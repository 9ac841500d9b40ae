"""Parameters over rmw_zenoh keep the contract that every adapter keeps, on real sockets."""

from __future__ import annotations

import pytest

from beacon_core.testing.contract import AdapterContract
from beacon_core.testing.contract.lifecycle import LifecycleChecks
from beacon_core.testing.harness import Harness
from beacon_zenoh.rmw_param.harness import RmwParamHarness

pytestmark = pytest.mark.system


class TestZenohRmwParam(AdapterContract):
    """As by default: a source also listens to what nodes tell of their parameters."""

    def make_harness(self) -> Harness:
        return RmwParamHarness()


class TestZenohRmwParamByPollsAlone(LifecycleChecks):
    """Without parameter events, which differs in how goodbyes are seen."""

    def make_harness(self) -> Harness:
        return RmwParamHarness(parameter_events=False)
