"""Wrong: a receiver of track codes that holds its last word for ever."""

from rail_onboard.track_code.receiver_node import TrackCodeReceiverNode


class HoldingReceiver(TrackCodeReceiverNode, name="track_code", namespace="/train_1"):
    def setup(self):
        super().setup()
        publish, self._held = self._publish, None

        def hold(stamp_ns, values):
            if values[0, 1]:
                self._held = values.copy()
            publish(stamp_ns, values if self._held is None else self._held)

        self._publish = hold


if __name__ == "__main__":
    HoldingReceiver.main()
