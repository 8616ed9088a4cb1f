#include "body/modal/structure/impulses.h"

#include <math.h>

#include "body/modal/forces.h"
#include "contact/complementarity.h"

void vi_structure_give_impulses(const vi_structure *s, const double impulse[], const double low[])
{
    for (int k = 0; k < s->model->contacts; ++k) {
        const double sign = vi_structure_direction(s, k), push = -sign * impulse[k], push_low = -sign * low[k];
        for (int j = 0; j < vi_structure_modes(s->model) && push != 0.0; ++j) {
            const double gain = s->model->impulse[k][j], step = gain * push, before = s->state->p[j];
            const double sum = before + step, part = sum - before;
            const double rounding = (before - (sum - part)) + (step - part);
            s->state->p[j] = sum + (rounding + (fma(gain, push, -step) + gain * push_low));
        }
    }
}

/* The rounding residual of the impulses p > 0 of g p = b, with g given to twice its digits. */
static void refine(int n, double g[VI_PORTS][VI_PORTS], double low[VI_PORTS][VI_PORTS], const double b[],
                   const double p[], double more[])
{
    double left[VI_PORTS] = {0.0};
    int active[VI_PORTS] = {0};
    for (int i = 0; i < n; ++i) {
        double sum = b[i], rounding = 0.0;
        active[i] = p[i] > 0.0;
        for (int j = 0; j < n; ++j) {
            const double product = -g[i][j] * p[j], total = sum + product, part = total - sum;
            rounding += fma(-g[i][j], p[j], -product) + ((sum - (total - part)) + (product - part)) - low[i][j] * p[j];
            sum = total;
        }
        left[i] = sum + rounding;
    }
    vi_solve_active(n, g, left, active, more);
}

/* The impulse of a contact that is alone in play. */
static void own_impulse(const vi_structure *s, int k, double change, double *impulse, double *impulse_low)
{
    const double g = s->model->mobility[k][k], p = change / g;
    *impulse = p;
    *impulse_low = (fma(-g, p, change) - s->model->mobility_low[k][k] * p) / g;
}

void vi_structure_joint_impulses(const vi_structure *s, const int in_play[], const double change[], double impulse[],
                                 double impulse_low[])
{
    int index[VI_PORTS], count = 0;
    for (int k = 0; k < s->model->contacts; ++k) {
        impulse[k] = impulse_low[k] = 0.0;
        if (in_play[k]) {
            index[count++] = k;
        }
    }
    if (count == 1 && s->model->mobility[index[0]][index[0]] > 0.0) {
        const int k = index[0];
        own_impulse(s, k, change[k], &impulse[k], &impulse_low[k]);
        return;
    }
    double whole[VI_PORTS][VI_PORTS], whole_low[VI_PORTS][VI_PORTS], g[VI_PORTS][VI_PORTS], low[VI_PORTS][VI_PORTS];
    double b[VI_PORTS] = {0.0}, p[VI_PORTS], more[VI_PORTS];
    vi_structure_signed(s, s->model->mobility, whole);
    vi_structure_signed(s, s->model->mobility_low, whole_low);
    for (int i = 0; i < count; ++i) {
        b[i] = change[index[i]];
        for (int j = 0; j < count; ++j) {
            g[i][j] = whole[index[i]][index[j]];
            low[i][j] = whole_low[index[i]][index[j]];
        }
    }
    vi_complementary(count, g, b, p);
    refine(count, g, low, b, p, more);
    for (int i = 0; i < count; ++i) {
        impulse[index[i]] = p[i];
        impulse_low[index[i]] = more[i];
    }
}
