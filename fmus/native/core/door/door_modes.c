#include "door/door_modes.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "door/door.h"
#include "modes/beam_modes.h"
#include "modes/chain_modes.h"

VI_DOOR int vi_door_most_modes(void)
{
    return VI_MODES;
}

VI_DOOR int vi_door_chain_modes(int masses, const double mass[], const double stiffness[], const double damping[],
                                double natural[], double damping_ratio[], double shape[], double modal_damping[])
{
    if (masses < 1 || masses > VI_MODES) {
        return -1;
    }
    vi_chain chain = {.masses = masses};
    memcpy(chain.mass, mass, (size_t)masses * sizeof *mass);
    memcpy(chain.stiffness, stiffness, ((size_t)masses + 1) * sizeof *stiffness);
    memcpy(chain.damping, damping, ((size_t)masses + 1) * sizeof *damping);
    vi_chain_modes modes;
    if (!vi_chain_find_modes(&chain, &modes)) {
        return -1;
    }
    const size_t row = (size_t)masses * sizeof(double);
    memcpy(natural, modes.natural, row);
    memcpy(damping_ratio, modes.damping_ratio, row);
    for (int i = 0; i < masses; ++i) {
        memcpy(shape + i * masses, modes.shape[i], row);
        memcpy(modal_damping + i * masses, modes.damping[i], row);
    }
    return modes.classical ? 1 : 0;
}

static bool in_range(int boundary, int count)
{
    return boundary >= VI_CLAMPED_FREE && boundary <= VI_PINNED_PINNED && count >= 1;
}

static bool on_beam(int points, const double s[])
{
    for (int k = 0; k < points; ++k) {
        if (!(s[k] >= 0.0 && s[k] <= 1.0)) {
            return false;
        }
    }
    return true;
}

VI_DOOR int vi_door_beam_modes(int boundary, int count, double eigenvalue[], double participation[])
{
    if (!in_range(boundary, count)) {
        return 1;
    }
    for (int j = 1; j <= count; ++j) {
        eigenvalue[j - 1] = vi_beam_eigenvalue((vi_beam_boundary)boundary, j);
        participation[j - 1] = vi_beam_participation((vi_beam_boundary)boundary, j);
    }
    return 0;
}

VI_DOOR int vi_door_beam_shapes(int boundary, int count, int points, const double s[], int derivative, double shape[])
{
    if (!in_range(boundary, count) || !on_beam(points, s) || derivative < 0 || derivative > 3) {
        return 1;
    }
    for (int k = 0; k < points; ++k) {
        for (int j = 1; j <= count; ++j) {
            shape[k * count + j - 1] = vi_beam_shape((vi_beam_boundary)boundary, j, s[k], derivative);
        }
    }
    return 0;
}

VI_DOOR double vi_door_beam_static_stiffness(int boundary, double s)
{
    const bool good = in_range(boundary, 1) && on_beam(1, &s);
    return good ? vi_beam_static_stiffness((vi_beam_boundary)boundary, s) : (double)NAN;
}

VI_DOOR double vi_door_beam_validity(int boundary, int j, double slenderness, double e_over_g, double shear_coefficient)
{
    const bool good = in_range(boundary, j) && slenderness >= 0.0 && e_over_g >= 0.0 && shear_coefficient > 0.0;
    if (!good) {
        return (double)NAN;
    }
    return vi_beam_validity((vi_beam_boundary)boundary, j, slenderness, e_over_g, shear_coefficient);
}

VI_DOOR int vi_door_beam_collocation(int boundary, int n, const double s[], int at, double direction[])
{
    if (!in_range(boundary, n) || n > VI_MODES || at < 0 || at >= n || !on_beam(n, s)) {
        return 1;
    }
    return vi_beam_collocation((vi_beam_boundary)boundary, n, s, at, direction) ? 0 : 2;
}
