#include "door/door_modes.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "door/door.h"
#include "modes/beam_modes.h"
#include "modes/beam_residual.h"
#include "modes/chain_modes.h"
#include "modes/singular.h"
#include "modes/symmetric.h"

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

/* Returns 0; 1 for invalid numbers; 2 for points too close to each other or to a support. */
static int find_residual(int boundary, int natural, int points, const double point[], vi_beam_residual *residual)
{
    if (!in_range(boundary, natural) || points < 1 || points > VI_PORTS || !on_beam(points, point)) {
        return 1;
    }
    return vi_beam_residual_find(residual, (vi_beam_boundary)boundary, natural, points, point) == 0 ? 0 : 2;
}

VI_DOOR int vi_door_beam_residual(int boundary, int natural, int points, const double point[], double eigenvalue[],
                                  double participation[])
{
    vi_beam_residual residual;
    const int refused = find_residual(boundary, natural, points, point, &residual);
    for (int i = 0; refused == 0 && i < points; ++i) {
        eigenvalue[i] = residual.eigenvalue[i];
        participation[i] = vi_beam_residual_participation(&residual, i);
    }
    return refused;
}

VI_DOOR int vi_door_beam_residual_shapes(int boundary, int natural, int points, const double point[], int places,
                                         const double s[], double shape[])
{
    vi_beam_residual residual;
    const int refused = on_beam(places, s) ? find_residual(boundary, natural, points, point, &residual) : 1;
    for (int k = 0; refused == 0 && k < places; ++k) {
        for (int i = 0; i < points; ++i) {
            shape[k * points + i] = vi_beam_residual_shape(&residual, i, s[k]);
        }
    }
    return refused;
}

VI_DOOR int vi_door_chain_modes(int masses, const double mass[], const double stiffness[], const double damping[],
                                double natural[], double damping_ratio[], double shape[], double coupling[])
{
    vi_chain chain;
    vi_chain_modes modes;
    if (masses < 1 || masses > VI_MODES) {
        return -1;
    }
    memset(&chain, 0, sizeof chain);
    chain.masses = masses;
    memcpy(chain.mass, mass, (size_t)masses * sizeof mass[0]);
    memcpy(chain.stiffness, stiffness, (size_t)(masses + 1) * sizeof stiffness[0]);
    memcpy(chain.damping, damping, (size_t)(masses + 1) * sizeof damping[0]);
    if (!vi_chain_find_modes(&chain, &modes)) {
        return -1;
    }
    memcpy(natural, modes.natural, (size_t)masses * sizeof natural[0]);
    memcpy(damping_ratio, modes.damping_ratio, (size_t)masses * sizeof damping_ratio[0]);
    for (int i = 0; i < masses; ++i) {
        memcpy(shape + (ptrdiff_t)i * masses, modes.shape[i], (size_t)masses * sizeof shape[0]);
        memcpy(coupling + (ptrdiff_t)i * masses, modes.damping[i], (size_t)masses * sizeof coupling[0]);
    }
    return modes.classical ? 0 : 1;
}

/* Add a row to a triangular factor by Givens rotations, which leave the product B'B as if the row were one of B. */
static void fold_row(int columns, double factor[][VI_MODES], double row[])
{
    for (int j = 0; j < columns; ++j) {
        const double length = hypot(factor[j][j], row[j]);
        if (row[j] == 0.0 || !(length > 0.0)) {
            continue;
        }
        const double cosine = factor[j][j] / length, sine = row[j] / length;
        for (int k = j; k < columns; ++k) {
            const double above = factor[j][k], below = row[k];
            factor[j][k] = cosine * above + sine * below;
            row[k] = cosine * below - sine * above;
        }
    }
}

VI_DOOR int vi_door_spring_modes(int rows, int columns, const double spring[], double value[], double vector[])
{
    if (rows < 0 || columns < 1 || columns > VI_MODES) {
        return -1;
    }
    double factor[VI_ROWS][VI_MODES], row[VI_MODES];
    vi_singular singular;
    const bool folds = rows > VI_ROWS;
    memset(factor, 0, sizeof factor);
    for (int i = 0; i < rows; ++i) {
        memcpy(row, spring + (ptrdiff_t)i * columns, (size_t)columns * sizeof row[0]);
        if (folds) {
            fold_row(columns, factor, row);
        } else {
            memcpy(factor[i], row, (size_t)columns * sizeof row[0]);
        }
    }
    if (!vi_singular_find(folds ? columns : rows, columns, factor, &singular)) {
        return -1;
    }
    memcpy(value, singular.value, (size_t)singular.rank * sizeof value[0]);
    for (int k = 0; k < singular.rank; ++k) {
        memcpy(vector + (ptrdiff_t)k * columns, singular.right[k], (size_t)columns * sizeof vector[0]);
    }
    return singular.rank;
}

typedef struct {
    vi_complex matrix[VI_STATES][VI_STATES], vector[VI_STATES][VI_STATES];
} symmetric_work;

/* Entry of the sum of sign spring' spring, to twice the digits, rounded once. */
static double signed_entry(int rows, int columns, const double spring[], const double sign[], int i, int j)
{
    double sum = 0.0, left = 0.0;
    for (int k = 0; k < rows; ++k) {
        const double a = sign[k] * spring[(ptrdiff_t)k * columns + i], b = spring[(ptrdiff_t)k * columns + j];
        const double product = a * b, total = sum + product, part = total - sum;
        left += fma(a, b, -product) + ((sum - (total - part)) + (product - part));
        sum = total;
    }
    return sum + left;
}

VI_DOOR int vi_door_signed_modes(int rows, int columns, const double spring[], const double sign[], double value[],
                                 double vector[])
{
    if (rows < 0 || columns < 1 || columns > VI_MODES) {
        return -1;
    }
    symmetric_work *work = calloc(1, sizeof *work);
    if (work == NULL) {
        return 1;
    }
    bool good = true;
    for (int i = 0; i < columns; ++i) {
        for (int j = 0; j < columns; ++j) {
            work->matrix[i][j].re = signed_entry(rows, columns, spring, sign, i < j ? i : j, i < j ? j : i);
            good = good && isfinite(work->matrix[i][j].re);
        }
    }
    const bool found = good && vi_symmetric_find(columns, work->matrix, work->vector);
    bool taken[VI_MODES] = {false};
    for (int k = 0; k < columns && found; ++k) {
        int least = -1;
        for (int i = 0; i < columns; ++i) {
            least = !taken[i] && (least < 0 || work->matrix[i][i].re < work->matrix[least][least].re) ? i : least;
        }
        taken[least] = true;
        value[k] = copysign(sqrt(fabs(work->matrix[least][least].re)), work->matrix[least][least].re);
        for (int j = 0; j < columns; ++j) {
            vector[(ptrdiff_t)k * columns + j] = work->vector[least][j].re;
        }
    }
    free(work);
    return !good ? -1 : found ? 0 : 1;
}
