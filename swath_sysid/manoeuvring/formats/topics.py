"""Topics of the forecasts of surge, sway and yaw."""

PATH = 'nav_msgs/msg/Path'
PATH_TOPIC = 'manoeuvring/forecast'
LEADS = 'manoeuvring/lead_'  #: How the topics of forecasts at one lead begin.
