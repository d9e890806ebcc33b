"""The command ``roaas robot``: starts the simulated robot and its web services, or the web services alone."""

import sys
from importlib import import_module
from pathlib import Path
from typing import Final

import click

from conformance.commandline.exit_codes import ExitCode
from reference_robot.ending import RosCommand
from reference_robot.kinematics import DIFFERENTIAL, KINEMATICS

_HIGHEST_DOMAIN_ID: Final = 101
_FILE: Final = click.Path(exists=True, dir_okay=False, path_type=Path)
_PORT: Final = click.IntRange(0, 65535)

# Modules that the robot imports, and how to install them.
_NEEDED: Final = {
    "rclpy": "ROS 2 Jazzy: pip install 'roaas[robot,ros]', "
    "or apt's ros-jazzy-rclpy and `source /opt/ros/jazzy/setup.bash`",
    "mybot_delivery_app.msg": "the interface package: pip install reference_robot/interfaces/mybot_delivery_app",
    "nav2_msgs.action": "the interface package: pip install reference_robot/interfaces/nav2_msgs, "
    "or apt's ros-jazzy-nav2-msgs",
    "tf2_msgs.msg": "the interface package: pip install reference_robot/interfaces/tf2_msgs, "
    "or apt's ros-jazzy-tf2-msgs",
    "uvloop": "the event loop: pip install 'roaas[robot]'",
    "httptools": "the HTTP parser: pip install 'roaas[robot]'",
}


@click.command(cls=RosCommand, context_settings={"show_default": True})
@click.option("--config", type=_FILE, help="TOML file of names, limits and deadlines.")
@click.option("--host", default="127.0.0.1", help="Address to listen on.")
@click.option("--insecure", is_flag=True, help="Let every client that reaches --host drive the robot without a token.")
@click.option("--rest-port", type=_PORT, default=7003, help="0 takes a free one.")
@click.option("--soap-port", type=_PORT, default=5555, help="0 takes a free one.")
@click.option(
    "--domain-id", type=click.IntRange(0, _HIGHEST_DOMAIN_ID), envvar="ROS_DOMAIN_ID", default=0, help="ROS domain."
)
@click.option(
    "--time-scale",
    type=click.FloatRange(0, min_open=True),
    default=1.0,
    help="How many times faster the simulated robot moves.",
)
@click.option(
    "--realistic",
    is_flag=True,
    help="Simulate imperfections: slow odometry with noise and drift, wheels that slip, commands that arrive late.",
)
@click.option("--seed", type=int, default=0, help="With --realistic: which imperfections.")
@click.option(
    "--kinematics",
    type=click.Choice(list(KINEMATICS)),
    default=DIFFERENTIAL,
    help="Body of the simulated robot; reference_robot/NAME.toml is its statement.",
)
@click.option("--token-file", type=_FILE, help="Require a bearer token from this file; scopes limit its use.")
@click.option("--tls-cert", type=_FILE, help="Serve HTTPS with this certificate or chain (PEM).")
@click.option("--tls-key", type=_FILE, help="Private key of the certificate (PEM).")
@click.option(
    "--allowed-host",
    multiple=True,
    metavar="NAME",
    help="Accept this host name too; .NAME accepts all names below NAME. Repeatable.",
)
@click.option(
    "--public-url",
    multiple=True,
    metavar="[rest=|soap=]URL",
    help="Address of the robot, or of one interface, as clients see it through a proxy. Repeatable.",
)
@click.option(
    "--trusted-proxy",
    multiple=True,
    metavar="ADDRESS",
    help="Trust X-Forwarded-Proto and -Host from this address or network. Repeatable.",
)
@click.option("--attach", is_flag=True, help="Start no simulation; serve a robot that is on the ROS graph already.")
@click.option(
    "--delivery-only", is_flag=True, help="Run only the delivery application, for a robot that is on the ROS graph."
)
def robot(**options: object) -> None:
    """Run the reference robot.

    When both interfaces are ready, the command prints their addresses in one line. SIGINT, SIGTERM and SIGHUP stop it.
    Arguments after --ros-args are passed to ROS: namespaces, remappings, parameters such as use_sim_time, enclaves.
    """
    for module, remedy in _NEEDED.items():
        try:
            import_module(module)
        except ImportError as error:
            click.echo(f"roaas robot needs {module}, which cannot be imported ({error}). Install {remedy}", err=True)
            sys.exit(ExitCode.USAGE)
    # Imported only here, because the module imports ROS and the web server.
    launch = import_module("reference_robot.launch")
    launch.run(launch.Options(**options))
