"""The mask network: a small U-Net over the channels of `view.py`, 96 × 64 cells, one logit per cell.

It works on cells of twice the side and gives four logits for each, which costs a third of working on all cells.
"""

from torch import nn

CHANNELS = 9  # as in view.py, which needs OpenCV
WIDTHS = (32, 48, 80)


def block(inside, outside, stride=1, side=3):
    return nn.Sequential(nn.Conv2d(inside, outside, side, stride, 1, bias=False), nn.BatchNorm2d(outside), nn.ReLU(inplace=True))


class MaskNetwork(nn.Module):
    def __init__(self):
        super().__init__()
        self.down = nn.ModuleList()
        before = CHANNELS
        for level, width in enumerate(WIDTHS):
            self.down.append(nn.Sequential(block(before, width, 2, 4 if level == 0 else 3), block(width, width)))
            before = width
        self.narrow = nn.ModuleList([nn.Conv2d(WIDTHS[k + 1], WIDTHS[k], 1) for k in range(len(WIDTHS) - 1)])
        self.up = nn.ModuleList([block(WIDTHS[k], WIDTHS[k]) for k in range(len(WIDTHS) - 1)])
        self.larger = nn.Upsample(scale_factor=2, mode="nearest")
        self.read = nn.Sequential(nn.Conv2d(WIDTHS[0], 4, 3, 1, 1), nn.PixelShuffle(2))

    def forward(self, x):
        kept = []
        for level in self.down:
            x = level(x)
            kept.append(x)
        for k in reversed(range(len(WIDTHS) - 1)):
            x = self.up[k](kept[k] + self.larger(self.narrow[k](x)))
        return self.read(x)[:, 0]
