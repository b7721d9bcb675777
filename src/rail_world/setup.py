from setuptools import find_packages, setup

package_name = "rail_world"

setup(
    name=package_name,
    version="0.1.0",
    description="The truth of the corridor: tracks, train motion, the media and the tick.",
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
            "world = rail_world.world_node:WorldNode.main",
            "radio_medium = rail_world.ranging.medium_node:RadioMediumNode.main",
            "rail_medium = rail_world.track_code.medium_node:RailMediumNode.main",
            "cbtc_medium = rail_world.train_radio.medium_node:CbtcMediumNode.main",
            "backbone = rail_world.train_radio.backbone_node:BackboneNode.main",
            "reference_medium = rail_world.doppler.medium_node:ReferenceMediumNode.main",
            "bus_medium = rail_world.train_bus.medium_node:BusMediumNode.main",
        ],
    },
)
