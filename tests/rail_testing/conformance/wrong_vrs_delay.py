"""Wrong: a vehicle station whose delay has drifted by 0.3 us since it was calibrated."""

from rail_onboard.ranging.vrs_node import VrsNode


class DriftedVrs(VrsNode, name="vrs", namespace="/train_1"):
    def setup(self):
        super().setup()
        self._delay_s += 0.3e-6


if __name__ == "__main__":
    DriftedVrs.main()
