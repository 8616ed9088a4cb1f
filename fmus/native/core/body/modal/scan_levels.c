#include "body/modal/scan_levels.h"

#include <math.h>

#include "motion/majorant.h"

/* Shortest step in radians of the fastest rate. */
static const double SHORTEST = 0.05;

/* The fastest rate without the further sines, rad/s. */
static double rate_without_sines(const vi_structure_model *model)
{
    double rate = model->clock.angular_frequency;
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        const vi_mode *mode = &model->mode[j];
        rate = vi_max(rate, vi_max(mode->natural, 2.0 * fabs(mode->decay)));
        rate = mode->regime == VI_OVERDAMPED ? vi_max(rate, vi_max(mode->fast, -mode->slow)) : rate;
    }
    return rate;
}

/* Choose the shortest step. Faster sines shorten it by a power of 2: longer steps are those of the body without them. */
static void find_shortest(vi_scan *scan, const vi_structure_model *model)
{
    const double rate = scan->sines > 0 ? rate_without_sines(model) : 0.0;
    scan->shortest = SHORTEST * model->radian;
    scan->finer = 0;
    if (rate > 0.0 && rate < model->fastest) {
        double halved = SHORTEST / rate;
        for (; scan->finer < VI_SCAN_LEVELS - 1 && halved > scan->shortest; ++scan->finer) {
            halved *= 0.5;
        }
        scan->shortest = vi_min(halved, scan->shortest);
    }
}

void vi_scan_renew(vi_scan *scan, const vi_structure_model *model)
{
    bool same = scan->modes == vi_structure_modes(model) && scan->angular_frequency == model->clock.angular_frequency;
    for (int j = 0; j < vi_structure_modes(model) && same; ++j) {
        same = scan->stiffness[j] == model->mode[j].stiffness && scan->decay[j] == model->mode[j].decay;
    }
    const vi_mode *first = &model->mode[0];
    same = same && scan->sines == vi_mode_sines(first);
    for (int k = 0; k < vi_mode_sines(first) && same; ++k) {
        same = scan->further[k] == first->further[k].angular_frequency;
    }
    if (same) {
        return;
    }
    scan->sines = vi_mode_sines(first);
    for (int k = 0; k < vi_mode_sines(first); ++k) {
        scan->further[k] = first->further[k].angular_frequency;
    }
    scan->modes = vi_structure_modes(model);
    scan->angular_frequency = model->clock.angular_frequency;
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        scan->stiffness[j] = model->mode[j].stiffness;
        scan->decay[j] = model->mode[j].decay;
    }
    find_shortest(scan, model);
    for (int l = 0; l < VI_SCAN_LEVELS; ++l) {
        scan->level[l].step = 0.0;
    }
}

static void make(vi_scan_level *level, const vi_scan *scan, const vi_structure_model *model, int l)
{
    level->step = vi_scan_step(scan, l);
    for (int i = 0; i < VI_SCAN_SAMPLES; ++i) {
        const double time = (double)(i + 1) * level->step;
        level->cosine[i] = cos(scan->angular_frequency * time);
        level->sine[i] = sin(scan->angular_frequency * time);
        for (int k = 0; k < vi_mode_sines(&model->mode[0]); ++k) {
            level->further_cosine[k][i] = cos(scan->further[k] * time);
            level->further_sine[k][i] = sin(scan->further[k] * time);
        }
        for (int j = 0; j < vi_structure_modes(model); ++j) {
            double phi[4];
            vi_mode_propagator(&model->mode[j], time, phi);
            level->x_of_x[j][i] = phi[0];
            level->x_of_v[j][i] = phi[1];
            level->v_of_x[j][i] = phi[2];
            level->v_of_v[j][i] = phi[3];
        }
    }
}

const vi_scan_level *vi_scan_level_of(vi_scan *scan, const vi_structure_model *model, int l)
{
    vi_scan_level *level = &scan->level[l];
    if (level->step == 0.0) {
        make(level, scan, model, l);
    }
    return level;
}
