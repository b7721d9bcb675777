from setuptools import find_packages, setup

package_name = "rail_onboard"

setup(
    name=package_name,
    version="0.1.0",
    description="On-board equipment: ranging transponder, receivers and radio, train protection.",
    license="Apache-2.0",
    maintainer="Rail Corridor maintainers",
    maintainer_email="maintainers@rail-corridor.example",
    packages=find_packages(include=[package_name, f"{package_name}.*"]),
    package_data={package_name: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "vrs = rail_onboard.ranging.vrs_node:VrsNode.main",
            "track_code_receiver = rail_onboard.track_code.receiver_node:TrackCodeReceiverNode.main",
            "code_supervision = rail_onboard.track_code.supervision_node:CodeSupervisionNode.main",
            "cbtc_radio = rail_onboard.train_radio.radio_node:CbtcRadioNode.main",
            "atp = rail_onboard.train_radio.atp_node:AtpNode.main",
            "doppler_positioner = rail_onboard.doppler.positioner_node:DopplerPositionerNode.main",
            "localizer = rail_onboard.localizer.localizer_node:LocalizerNode.main",
            "bus_terminal = rail_onboard.train_bus.terminal_node:BusTerminalNode.main",
            "train_bus_monitor = rail_onboard.train_bus.monitor_node:TrainBusMonitorNode.main",
        ],
    },
)
