"""Wrong: a localizer that claims half its protection level, with the same deviation."""

import numpy as np

from rail_onboard.localizer.localizer_node import LocalizerNode


class BoldLocalizer(LocalizerNode, name="localizer", namespace="/train_1"):
    def setup(self):
        super().setup()
        send = self._state

        def halve(stamp_ns, values):
            row = np.array(values)
            middle_m = row[0, 4]
            if np.isfinite(middle_m):
                row[0, 5:7] = middle_m + 0.1 * (row[0, 5:7] - middle_m)
            send(stamp_ns, row)

        self._state = halve


if __name__ == "__main__":
    BoldLocalizer.main()
