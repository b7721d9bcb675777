"""Wrong: a zone controller that gives authorities up to the middle of the train ahead."""

from rail_wayside.train_radio import moving_block
from rail_wayside.zone_controller_node import ZoneControllerNode

authority = moving_block.MovingBlock.authority


def to_the_middle(self, train, time_s):
    bounds = self._trains.get(train)
    if bounds is None or bounds.above is None:
        return authority(self, train, time_s)
    given = authority(self, train, time_s)
    ahead = bounds.above
    if given is None:
        return None
    return given._replace(end_m=0.5 * (ahead.rear_m + ahead.front_m))


if __name__ == "__main__":
    moving_block.MovingBlock.authority = to_the_middle
    ZoneControllerNode.main()
