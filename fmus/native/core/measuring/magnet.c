#include "measuring/magnet.h"

double vi_magnet_gap(const vi_magnet *magnet, double displacement)
{
    if (!(magnet->distance > 0.0)) {
        return 1.0;
    }
    const double part = displacement / magnet->distance;
    return magnet->side == VI_MAGNET_UPPER ? 1.0 - part : 1.0 + part;
}

double vi_magnet_force(const vi_magnet *magnet, double volts, double displacement)
{
    const double gap = vi_magnet_gap(magnet, displacement);
    return (magnet->gain * volts + magnet->offset) / (gap * gap);
}
