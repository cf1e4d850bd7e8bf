import pytest
import torch

from agents.occupancy_net import OCCUPANCY_NETS, PlainUnet, ResidualUnet, occupancy_net


def num_parameters(net: torch.nn.Module) -> int:
    return sum(parameter.numel() for parameter in net.parameters())


@pytest.mark.parametrize("name", sorted(OCCUPANCY_NETS))
def test_raster_keeps_its_size(name: str) -> None:
    net = occupancy_net(name, inputs=3, outputs=2, width=8)
    assert net(torch.rand(2, 3, 64, 80)).shape == (2, 2, 64, 80)


def test_networks_of_published_width_have_the_published_size() -> None:
    assert num_parameters(ResidualUnet(3, 3, width=64)) == pytest.approx(5.0e6, rel=0.01)
    assert num_parameters(PlainUnet(2, 2, width=16)) == pytest.approx(0.84e6, rel=0.01)


@pytest.mark.parametrize("name", sorted(OCCUPANCY_NETS))
def test_far_cells_reach_the_output(name: str) -> None:
    torch.manual_seed(0)
    net = occupancy_net(name, inputs=3, outputs=3, width=8).eval()
    raster = torch.rand(1, 3, 80, 80, requires_grad=True)
    net(raster)[0, 0, 40, 40].backward()
    assert raster.grad is not None
    assert raster.grad[0, :, 40 - 24, 40].abs().sum() > 0.0


@pytest.mark.parametrize("name", sorted(OCCUPANCY_NETS))
def test_every_weight_is_used(name: str) -> None:
    net = occupancy_net(name, inputs=2, outputs=2, width=8)
    net(torch.rand(2, 2, 32, 32)).square().mean().backward()
    assert [key for key, value in net.named_parameters() if value.grad is None] == []


def test_network_learns_to_copy() -> None:
    torch.manual_seed(0)
    net = occupancy_net("residual", 3, 3, 8)
    optimizer = torch.optim.Adam(net.parameters(), lr=1e-2)
    labels = torch.randint(3, (2, 4, 4)).repeat_interleave(4, 1).repeat_interleave(4, 2)
    raster = torch.nn.functional.one_hot(labels, 3).permute(0, 3, 1, 2).float()
    for _ in range(30):
        optimizer.zero_grad()
        torch.nn.functional.cross_entropy(net(raster), labels).backward()
        optimizer.step()
    assert (net.eval()(raster).argmax(dim=1) == labels).float().mean() > 0.9


def test_odd_raster_is_refused() -> None:
    net = occupancy_net("plain", 2, 2, 4)
    with pytest.raises(
        ValueError, match=r"`raster` must be \(N, C, h, w\) with edges that are multiples of 16"
    ):
        net(torch.rand(1, 2, 65, 65))


def test_unknown_network_lists_the_choices() -> None:
    with pytest.raises(ValueError, match="unknown network 'vit'; choose one of: residual, plain"):
        occupancy_net("vit", 3, 3, 8)


def test_width_is_what_the_kernels_can_take() -> None:
    with pytest.raises(ValueError, match="`width` must be >= 8, got 4"):
        occupancy_net("residual", inputs=3, outputs=3, width=4)
    with pytest.raises(ValueError, match="`width` must be >= 1, got 0"):
        occupancy_net("plain", 3, 3, 0)
