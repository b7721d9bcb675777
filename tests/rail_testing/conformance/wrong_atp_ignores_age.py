"""Wrong: train protection that obeys an authority however old it is."""

from dataclasses import replace

from rail_onboard.train_radio import supervision
from rail_onboard.train_radio.atp_node import AtpNode


class AgelessSupervision(supervision.AuthoritySupervision):
    def update(self, time_s, *arguments, authority=None, **others):
        if authority is not None:
            authority = replace(authority, validity_s=1e6)
        self._timeout_s = 1e6
        return super().update(time_s, *arguments, authority=authority, **others)


if __name__ == "__main__":
    import rail_onboard.train_radio.atp_node as atp_node

    atp_node.AuthoritySupervision = AgelessSupervision
    AtpNode.main()
