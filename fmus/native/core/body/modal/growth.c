#include "body/modal/growth.h"

#include <float.h>
#include <stdbool.h>

#include "motion/majorant.h"

/* Rounding of a damping matrix, as a part of its size; times the number of modes. */
static const double MATRIX_ROUNDING = 64.0 * DBL_EPSILON;

static double size_of_damping(const vi_structure_model *model)
{
    double size = 0.0;
    for (int i = 0; i < vi_structure_modes(model); ++i) {
        for (int j = 0; j < vi_structure_modes(model); ++j) {
            size = vi_max(size, fabs(model->coupling[i][j]));
        }
    }
    return size;
}

/* Does the damping matrix take energy from each motion, within rounding? Cholesky's factor of the matrix with a little
 * more on its diagonal exists. */
static bool never_gains(const vi_structure_model *model, double slack)
{
    double factor[VI_MODES][VI_MODES];
    for (int i = 0; i < vi_structure_modes(model); ++i) {
        for (int j = 0; j <= i; ++j) {
            double left = model->coupling[i][j] + (i == j ? slack : 0.0);
            for (int k = 0; k < j; ++k) {
                left -= factor[i][k] * factor[j][k];
            }
            if (i == j && !(left > 0.0)) {
                return false;
            }
            factor[i][j] = i == j ? sqrt(left) : left / factor[j][j];
        }
    }
    return true;
}

double vi_growth_of(const vi_structure_model *model)
{
    const double modes = (double)vi_structure_modes(model), size = model->coupled ? size_of_damping(model) : 0.0;
    double growth = 0.0;
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        const vi_mode *mode = &model->mode[j];
        const double by_spring = mode->stiffness < 0.0 ? mode->natural : 0.0;
        growth = vi_max(growth, model->coupled ? by_spring : mode->growth);
    }
    const bool gains = size > 0.0 && !never_gains(model, MATRIX_ROUNDING * size * modes);
    return gains ? growth + modes * size : growth;
}
