"""Trains the people network on rendered pictures, logs the curve, keeps the running average of the weights.

    python3 train.py --nanodet nanodet_g_416.onnx --data ../../target/datasets/people/train \
        --validation ../../target/datasets/people/validation --out RUN --minutes 100
"""

import json
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import torch
from torch.nn import functional

sys.path.append(str(Path(__file__).resolve().parent.parent))  # behind this folder: names are the same in both

from common import average_in, batches, begin, curve_of, descend, keep, parser_of, rate_at, with_average
from dataset import Frames, sample, targets, whole
from network import BALL_STRIDE, BINS, ROLES, STRIDE, PeopleNetwork, distances, start_from_exported, start_from_nanodet

BATCH = 6
WEIGHT_DECAY = 0.01
AVERAGE = 0.998
ROLE_WEIGHTS = (1.0, 3.0, 2.0, 2.0)
SCORE_MIN, BALL_SCORE_MIN = 0.4, 0.3  # from which something counts as found in validation
SAME_IOU = 0.55
MISTAKEN_MIN = 0.1  # score from which a place that is not the ball was taken for it


def stack(samples):
    pictures = torch.from_numpy(np.stack([s.view for s in samples])).permute(0, 3, 1, 2)
    return pictures.contiguous(memory_format=torch.channels_last)


def box_of(reach, x, y):
    """Boxes from distances (n×4) to left, top, right, bottom of the points x, y."""
    return torch.stack([x - reach[:, 0], y - reach[:, 1], x + reach[:, 2], y + reach[:, 3]], 1)


def overlaps(a, b):
    """IoU and generalised IoU of n pairs of boxes."""
    area = lambda c: (c[:, 2] - c[:, 0]).clamp(min=0) * (c[:, 3] - c[:, 1]).clamp(min=0)
    both = (torch.minimum(a[:, 2], b[:, 2]) - torch.maximum(a[:, 0], b[:, 0])).clamp(min=0) * (
        torch.minimum(a[:, 3], b[:, 3]) - torch.maximum(a[:, 1], b[:, 1])
    ).clamp(min=0)
    either = area(a) + area(b) - both
    hull = (torch.maximum(a[:, 2], b[:, 2]) - torch.minimum(a[:, 0], b[:, 0])) * (torch.maximum(a[:, 3], b[:, 3]) - torch.minimum(a[:, 1], b[:, 1]))
    iou = both / either.clamp(min=1e-3)
    return iou, iou - (hull - either) / hull.clamp(min=1e-3)


def loss_of(people, ball, samples):
    """Quality focal loss of who is there, generalised IoU and distribution loss of the boxes (Li et al. 2020), cross entropy of the roles;
    penalty-reduced focal loss of the ball (Law and Deng 2018) with its place and size."""
    wanted = [targets(s) for s in samples]
    owner = torch.from_numpy(np.stack([w[0] for w in wanted]))
    image, row, column = (owner >= 0).nonzero(as_tuple=True)
    reach = distances(people)[image, :, row, column]
    x, y = (column + 0.5) * STRIDE - 0.5, (row + 0.5) * STRIDE - 0.5
    number = owner[image, row, column]
    boxes = torch.from_numpy(np.concatenate([s.boxes for s in samples]))
    kinds = torch.from_numpy(np.concatenate([s.kinds for s in samples]))
    first = torch.tensor(np.cumsum([0] + [len(s.boxes) for s in samples])[:-1])
    index = first[image] + number
    truth = boxes[index]
    iou, generalised = overlaps(box_of(reach, x, y), truth)

    quality = torch.zeros(owner.shape)
    quality[image, row, column] = iou.detach().clamp(min=0.3)
    said = people[:, 0]
    entropy = functional.binary_cross_entropy_with_logits(said, quality, reduction="none")
    focal = entropy * (torch.sigmoid(said) - quality).square() * (owner != -2)
    count = max(len(image), 20)
    weight = iou.detach().clamp(min=0.3)
    bins = people[:, 1 + len(ROLES) :].permute(0, 2, 3, 1)[image, row, column].reshape(-1, BINS)
    true_reach = torch.stack([x - truth[:, 0], y - truth[:, 1], truth[:, 2] - x, truth[:, 3] - y], 1) / STRIDE
    true_reach = true_reach.clamp(0, BINS - 1.01).reshape(-1)
    low = true_reach.floor().long()
    part = true_reach - low
    spread = functional.cross_entropy(bins, low, reduction="none") * (1 - part) + functional.cross_entropy(bins, low + 1, reduction="none") * part
    roles = people[:, 1 : 1 + len(ROLES)].permute(0, 2, 3, 1)[image, row, column]
    role = functional.cross_entropy(roles, kinds[index], torch.tensor(ROLE_WEIGHTS)) if len(index) else roles.sum()
    people_loss = focal.sum() / count + 2.0 * ((1 - generalised) * weight).sum() / count + 0.25 * (spread.view(-1, 4).mean(1) * weight).sum() / count + 0.3 * role

    heat, ask = (torch.from_numpy(np.stack([w[k] for w in wanted])) for k in (1, 2))
    cells = torch.from_numpy(np.stack([w[3] for w in wanted]))
    chance = torch.sigmoid(ball[:, 0]).clamp(1e-4, 1 - 1e-4)
    is_ball = torch.zeros_like(heat, dtype=torch.bool)
    there = (cells[:, 0] >= 0).nonzero(as_tuple=True)[0]
    u, v = cells[there, 0].long(), cells[there, 1].long()
    is_ball[there, v, u] = True
    hit = -((1 - chance) ** 2 * chance.log())[is_ball].sum()
    miss = -((1 - heat) ** 4 * chance**2 * (1 - chance).log() * ask)[~is_ball].sum()
    balls = max(len(there), 1)
    numbers = ball[there, 1:, v, u]
    place = functional.l1_loss(numbers[:, :2], cells[there, 2:4], reduction="sum") + 0.3 * functional.l1_loss(
        numbers[:, 2], (cells[there, 4].clamp(min=1.0) / BALL_STRIDE).log(), reduction="sum"
    )
    ball_loss = (hit + miss + 0.5 * place) / balls
    return people_loss, ball_loss


def decode(people, ball):
    """Boxes (n×4), scores, roles of one picture, best first and one per person; ball candidates (x, y, diameter, score), best first."""
    scores = torch.sigmoid(people[0, 0])
    row, column = (scores > 0.05).nonzero(as_tuple=True)
    boxes = box_of(distances(people)[0, :, row, column].T, (column + 0.5) * STRIDE - 0.5, (row + 0.5) * STRIDE - 0.5)
    scores, roles = scores[row, column], people[0, 1 : 1 + len(ROLES), row, column].argmax(0)
    kept = []
    for k in scores.argsort(descending=True).tolist():
        if not kept or overlaps(boxes[k][None].expand(len(kept), 4), boxes[kept])[0].max() <= SAME_IOU:
            kept.append(k)
    chance = torch.sigmoid(ball[0, 0])
    peak = (chance == functional.max_pool2d(chance[None, None], 5, 1, 2)[0, 0]) & (chance > 0.05)
    v, u = peak.nonzero(as_tuple=True)
    dx, dy, size = ball[0, 1:, v, u]
    candidates = torch.stack([(u + dx + 0.5) * BALL_STRIDE - 0.5, (v + dy + 0.5) * BALL_STRIDE - 0.5, size.exp() * BALL_STRIDE, chance[v, u]], 1)
    return boxes[kept], scores[kept], roles[kept], candidates[candidates[:, 3].argsort(descending=True)[:8]]


@torch.no_grad()
def validate(network, samples):
    """Recall and precision of people at IoU 0.5 and of the ball within its diameter (at least 4 px); share of right roles."""
    network.eval()
    people = found = right = balls = ball_found = ball_right = roles_right = 0
    for s in samples:
        boxes, scores, roles, candidates = decode(*network(stack([s])))
        truth = torch.from_numpy(s.boxes)
        taken = set()
        people += int(s.sure.sum())
        for box, score, role in zip(boxes, scores, roles):
            if score < SCORE_MIN:
                break
            iou = overlaps(box[None].expand(len(truth), 4), truth)[0] if len(truth) else torch.zeros(1)
            for k in iou.argsort(descending=True).tolist():
                if iou[k] >= 0.5 and k not in taken:
                    taken.add(k)
                    found += bool(s.sure[k])  # who need not be found is neither right nor wrong
                    right += bool(s.sure[k])
                    roles_right += bool(s.sure[k] and role == s.kinds[k])
                    break
            else:
                found += 1
        is_ball = s.ball is not None and s.ball[3] >= 0.4
        balls += is_ball
        if len(candidates) and candidates[0, 3] >= BALL_SCORE_MIN:
            ball_found += 1
            if is_ball:
                off = float(np.hypot(candidates[0, 0] - s.ball[0], candidates[0, 1] - s.ball[1]))
                ball_right += off <= max(s.ball[2], 4.0)
    network.train()
    share = lambda a, b: a / max(b, 1)
    return share(right, people), share(right, found), share(roles_right, right), share(ball_right, balls), share(ball_right, ball_found)


@torch.no_grad()
def mine(network, frames):
    """Notes in every frame what the network takes for the ball there, and is not; gives how many such places there are."""
    network.eval()
    for frame in frames:
        shown = whole(frame)
        candidates = decode(*network(stack([shown])))[3]
        wrong = candidates[candidates[:, 3] >= MISTAKEN_MIN].tolist()
        if frame.ball is not None:
            x, y, radius, _ = frame.ball
            wrong = [c for c in wrong if np.hypot(c[0] - x, c[1] - y) > max(4 * radius, 8.0)]
        frame.mistaken = [(c[0], c[1]) for c in wrong]
    network.train()
    return sum(len(frame.mistaken) for frame in frames)


def main():
    parser = parser_of(__doc__, minutes=100.0, rate=8e-4)
    parser.add_argument("--nanodet", help="NanoDet-g as ONNX, to start from without a checkpoint (see README.md)")
    parser.add_argument("--exported", help="people.onnx, to go on from; what it takes for the ball in the pictures and is not is shown more often")
    parser.add_argument("--backbone", type=float, default=0.25, help="share of the learning rate for NanoDet's layers")
    parser.add_argument("--pictures", type=int, default=48, help="pictures to watch the curve on")
    arguments = parser.parse_args()

    cv2.setNumThreads(0)
    rng, out = begin(arguments)
    data, watched = Frames(arguments.data), Frames(arguments.validation)
    watched = [whole(frame) for frame in watched.frames[:: max(len(watched) // arguments.pictures, 1)]]
    print(f"{len(data)} pictures to train on, {len(watched)} to watch the curve", flush=True)
    network = PeopleNetwork()
    if arguments.exported:
        start_from_exported(network, arguments.exported)
        print(f"{mine(network, data.frames)} places taken for the ball", flush=True)
    elif not arguments.start:
        start_from_nanodet(network, arguments.nanodet)
    network, average = with_average(network, arguments.start)
    backbone = {id(p) for p in network.backbone()}
    groups = [
        {"params": [p for p in network.parameters() if id(p) not in backbone], "share": 1.0},
        {"params": network.backbone(), "share": arguments.backbone},
    ]
    optimizer = torch.optim.AdamW(groups, arguments.rate, betas=(0.9, 0.99), weight_decay=WEIGHT_DECAY)
    curve = curve_of(out, ["people_loss", "ball_loss", "recall", "precision", "roles", "ball_recall", "ball_precision"])

    began, budget = time.time(), arguments.minutes * 60.0
    seen, steps, running, reported = 0, 0, None, 0.0
    supply = batches(data, BATCH, lambda: rng.permutation(len(data)), lambda indices: [sample(data.frames[k], rng) for k in indices])
    while True:
        elapsed = time.time() - began
        part = elapsed / max(budget, 1e-9)
        if part >= 1.0 or elapsed - reported >= 420.0:
            reported = elapsed
            figures = validate(average, watched)
            curve.writerow([f"{elapsed:.0f}", seen, *(f"{value:.4f}" for value in [*(running or (0, 0)), *figures])])
            print(f"{elapsed:.0f} s, {seen} samples, people found {figures[0]:.3f} right {figures[1]:.3f} role {figures[2]:.3f}, ball found {figures[3]:.3f} right {figures[4]:.3f}", flush=True)
            keep(out, network, average)
        if part >= 1.0:
            break
        for group in optimizer.param_groups:
            group["lr"] = rate_at(arguments.rate * group["share"], part, steps, warm_up=150)
        samples = next(supply)
        people, ball = network(stack(samples))
        people_loss, ball_loss = loss_of(people, ball, samples)
        descend(network, optimizer, people_loss + 0.5 * ball_loss, longest=10.0)
        steps += 1
        seen += BATCH
        now = people_loss.item(), ball_loss.item()
        running = now if running is None else tuple(0.98 * a + 0.02 * b for a, b in zip(running, now))
        if steps % 50 == 0:
            print(f"  {elapsed:.0f} s, {seen} samples, losses {running[0]:.3f} {running[1]:.3f}", flush=True)
        average_in(average, network, steps, AVERAGE)
    summary = {"samples_seen": seen, "training_pictures": len(data), "minutes": arguments.minutes, "seed": arguments.seed}
    (out / "run.json").write_text(json.dumps(summary))


if __name__ == "__main__":
    main()
