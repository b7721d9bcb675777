from setuptools import find_packages, setup

package_name = "rail_signals"

setup(
    name=package_name,
    version="0.1.0",
    description="Phase ranging and its bounds as pure functions of sampled waveforms.",
    license="Apache-2.0",
    maintainer="Rail Corridor maintainers",
    maintainer_email="maintainers@rail-corridor.example",
    packages=find_packages(include=[package_name, f"{package_name}.*"]),
    package_data={"": ["py.typed", "profiles/*.json"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
)
