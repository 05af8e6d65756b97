"""The soak test's users: each of their actions has its effect in the page and in the process that serves it."""

import pytest
from playwright.sync_api import Browser

from tests.browser.driver import IN_BROWSER
from tests.soak.server import Server
from tests.soak.users import WEIGHTS, Users

pytestmark = IN_BROWSER


@pytest.mark.slow
def test_every_action_has_its_effect(browser: Browser):
    server = Server()
    users = Users(browser, server, seed=3, pages=1, pace=0.0)
    users.act("branch")  # a second run, which can be deleted
    for name in WEIGHTS:
        users.act(name)
    assert users.troubles == []
    assert not users.refused
    assert set(users.done) == set(WEIGHTS)
    server.close()
