/* The functions that vibroimpact.fmus.core calls for measuring chains: blocks of samples, by the functions of the FMUs.
 *
 * The caller must check the ranges that the headers of `measuring` state.
 */
#ifndef VIBROIMPACT_DOOR_MEASURING_H
#define VIBROIMPACT_DOOR_MEASURING_H

#include <stddef.h>
#include <stdint.h>

#include "measuring/cell.h"

size_t vi_door_cell_size(void);

/* Start a cell settled under `force` at `time`. */
void vi_door_cell_start(vi_cell *cell, const vi_cell_settings *settings, double time, double force);

/* Output of the cell at `count` ascending instants, under a force that is linear between the given forces. The impacts
 * ascend, and none is later than the last instant. Returns 0; 1 when too many half sines overlap. */
int vi_door_cell_follow(vi_cell *cell, size_t count, const double times[], const double forces[], size_t hits,
                        const double hit_times[], const double impulses[], double volts[]);

void vi_door_gaussian(uint64_t seed, uint64_t channel, uint64_t first, size_t count, double numbers[]);
void vi_door_digitised(size_t count, const double volts[], double highest, int bits, double digitised[]);
void vi_door_reading(size_t count, const double values[], double gain, double offset, double highest, double volts[]);

/* Returns the number of the first sample at which body and exciter touch, or `count` when none does. */
size_t vi_door_magnet(size_t count, const double volts[], const double displacements[], double gain, double offset,
                      double distance, int side, double forces[]);

#endif
