from setuptools import find_packages, setup

package_name = "rail_wayside"

setup(
    name=package_name,
    version="0.1.0",
    description="Wayside equipment: ranging, track circuits, base stations, zone controllers.",
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
            "wrs = rail_wayside.ranging.wrs_node:WrsNode.main",
            "zone_controller = rail_wayside.zone_controller_node:ZoneControllerNode.main",
            "track_code_transmitter = rail_wayside.track_code.transmitter_node:TrackCodeTransmitterNode.main",
            "cbtc_base_station = rail_wayside.train_radio.base_station_node:CbtcBaseStationNode.main",
            "reference_station = rail_wayside.doppler.reference_station_node:ReferenceStationNode.main",
        ],
    },
)
