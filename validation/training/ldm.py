"""`python -m validation.training.ldm NAME...`: train the maps of LDM's experiments again.

It needs PyTorch. A training that is cut off goes on from its checkpoint.
"""

from dataclasses import asdict
from pathlib import Path

import torch
import typer
from tqdm import tqdm

from mpm_ref.rom.model_file import save
from mpm_ref.rom.study.reduce import decoder_model
from mpm_ref.rom.train.decoder import DecoderTraining, train_decoder
from mpm_ref.rom.train.loss import READINGS, LossWeights
from mpm_ref.rom.train.settings import device_of
from mpm_ref.training import DEVICES, Machine

from ..common.provenance import commit, provenance
from ..ldm.networks import FOLDER, SHARES, identity, nets
from .common import KEPT, Checkpoints, Device, Folder, Names, Threads, train_all

ROOT = Path(__file__).parents[2]


def training(net):
    """`DecoderTraining` of a `Net`."""
    shares, weights = SHARES[net.terms], READINGS[net.reading]
    scaled = LossWeights(*(share * weight for share, weight in zip(shares, weights, strict=True)))
    return DecoderTraining(net.r, weights=scaled, epochs=net.epochs, batch=net.batch,
                           points=net.points, dense=net.dense, every=net.thin, latent=net.latent,
                           seed=net.seed)


def made(name, checkpoints, machine):
    """`Model` of a net by name, with what is to be known of it."""
    net = nets()[name]
    plan, snapshots = training(net), net.study.run(net.study.train)
    with tqdm(total=plan.epochs, desc=name) as bar:
        def show(history):
            bar.update(len(history) - bar.n)
            bar.set_postfix(loss=f"{history[-1][0]:.2e}")
        done = train_decoder(plan, snapshots, checkpoints / f"{name}.pt", show,
                             device_of(machine.device))
    return decoder_model(done, snapshots.X, {
        **identity(net), "training": asdict(plan),
        "command": f"python -m validation.training.ldm {name}",
        **machine._asdict(), "torch": torch.__version__, **provenance(commit(ROOT))})


def main(names: Names = None, folder: Folder = FOLDER, checkpoints: Checkpoints = KEPT,
         threads: Threads = 1, device: Device = DEVICES[0]):
    """Train maps and write their weights."""
    machine = Machine(threads, device)

    def make(name, folder, checkpoints):
        save(folder / f"{name}.npz", made(name, checkpoints, machine))

    train_all(names, nets(), (folder, checkpoints), threads, make)


if __name__ == "__main__":
    typer.run(main)
