from tempfile import mkdtemp

import poise

FOLDER = mkdtemp()

# %% LiveSession
from poise.apps.live import LiveSession

with LiveSession(poise.load_robot("biped20"), FOLDER) as session:
    print(session.front.drive_url)  # the page that commands the robot
