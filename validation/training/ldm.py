"""`python -m validation.training.ldm NAME...`: train the maps of LDM's experiments again.

It needs PyTorch. An interrupted training continues from its checkpoint.
"""

from dataclasses import asdict

import typer
from tqdm import tqdm

from mpm_ref.rom.model_file import save
from mpm_ref.rom.study.reduce import decoder_model
from mpm_ref.rom.train.decoder import DecoderTraining, train_decoder
from mpm_ref.rom.train.loss import READINGS, LossWeights
from mpm_ref.rom.train.settings import device_of
from mpm_ref.training import DEVICES, Machine

from ..ldm.networks import FOLDER, SHARES, identity, nets
from .common import CHECKPOINTS, Checkpoints, Device, Folder, Names, Threads, origin, train_all


def training(net):
    """Return the `DecoderTraining` of a `MapNet`."""
    shares, weights = SHARES[net.terms], READINGS[net.reading]
    scaled = LossWeights(*(share * weight for share, weight in zip(shares, weights, strict=True)))
    return DecoderTraining(net.r, weights=scaled, epochs=net.epochs, batch=net.batch,
                           points=net.points, dense=net.dense, every=net.thin, latent=net.latent,
                           seed=net.seed)


def trained_map(name, checkpoints, machine):
    """Return the trained `Model` of a name, with how it was made."""
    net = nets()[name]
    plan, snapshots = training(net), net.study.run(net.study.train)
    with tqdm(total=plan.epochs, desc=name) as bar:
        def show(history):
            bar.update(len(history) - bar.n)
            bar.set_postfix(loss=f"{history[-1][0]:.2e}")
        done = train_decoder(plan, snapshots, checkpoints / f"{name}.pt", show,
                             device_of(machine.device))
    return decoder_model(done, snapshots.X, {
        **identity(net), "training": asdict(plan), **machine._asdict(), **origin("ldm", name)})


def main(names: Names = None, folder: Folder = FOLDER, checkpoints: Checkpoints = CHECKPOINTS,
         threads: Threads = 1, device: Device = DEVICES[0]):
    """Train maps and write their weights."""
    machine = Machine(threads, device)

    def make(name, folder, checkpoints):
        save(folder / f"{name}.npz", trained_map(name, checkpoints, machine))

    train_all(names, nets(), (folder, checkpoints), threads, make)


if __name__ == "__main__":
    typer.run(main)
