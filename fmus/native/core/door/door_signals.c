#include "door/door_signals.h"

#include <string.h>

#include "body/signal_check.h"
#include "door/door.h"

struct vi_door_signal {
    vi_signal signal;
    double time[VI_TABLE_ROOM], value[VI_TABLE_ROOM], bend[VI_TABLE_ROOM];
    vi_random random;
    vi_transform transform;
};

VI_DOOR size_t vi_door_signal_size(void)
{
    return sizeof(vi_door_signal);
}

VI_DOOR int vi_door_signal_start(vi_door_signal *memory, const vi_door_signal_settings *settings,
                                 char message[VI_MESSAGE_LENGTH])
{
    const vi_door_signal_settings *from = settings;
    const int count = from->count >= 0 && from->count <= VI_TABLE_ROOM ? (int)from->count : VI_TABLE_ROOM + 1;
    const vi_signal_kind kind = vi_signal_kind_of(from->kind);
    memory->signal = (vi_signal){
        .kind = kind, .start = from->start, .duration = from->duration, .angular_frequency = from->angular_frequency,
        .end_angular_frequency = from->end_angular_frequency, .phase = from->phase, .rise = from->rise,
        .seed = from->seed, .random = &memory->random, .transform = &memory->transform,
        .table = {count, memory->time, memory->value, NULL},
    };
    if (count > 0 && count <= VI_TABLE_ROOM) {
        memcpy(memory->time, from->time, (size_t)count * sizeof memory->time[0]);
        memcpy(memory->value, from->value, (size_t)count * sizeof memory->value[0]);
    }
    message[0] = '\0';
    vi_check_signal(message, "signal", &memory->signal);
    if (message[0] != '\0') {
        return 1;
    }
    if (kind == VI_TABLE_CUBIC) {
        vi_table_bend(count, memory->time, memory->value, memory->bend);
        memory->signal.table.bend = memory->bend;
    }
    vi_signal_prepare(&memory->signal);
    return 0;
}

VI_DOOR void vi_door_signal_values(vi_door_signal *memory, size_t count, const double times[], const double low[],
                                   double values[])
{
    vi_piece piece;
    for (size_t k = 0; k < count; ++k) {
        vi_signal_piece(&memory->signal, vi_twofold_of(times[k], low[k]), &piece);
        values[k] = piece.coefficient[0];
    }
}

VI_DOOR size_t vi_door_signal_pieces(vi_door_signal *memory, double begin, double end, size_t room, double start[][2],
                                     double length[], double coefficient[][VI_PIECE_DEGREE + 1])
{
    vi_piece piece;
    vi_twofold now = {begin, 0.0};
    size_t count = 0;
    while (count < room && now.high < end) {
        vi_signal_piece(&memory->signal, now, &piece);
        start[count][0] = now.high;
        start[count][1] = now.low;
        length[count] = piece.length;
        memcpy(coefficient[count], piece.coefficient, sizeof piece.coefficient);
        now = vi_twofold_sum(now, (vi_twofold){piece.length, 0.0});
        count += 1;
    }
    return count;
}
