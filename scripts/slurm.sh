#!/usr/bin/env bash
# Writes a Slurm job to standard output; submit it with sbatch.
#   scripts/slurm.sh render NODES DEVICES SCENE -o OUT.exr [options]     one render: a rank per node with all devices, by mpirun
#   scripts/slurm.sh experiment NODES DEVICES CONFIG -o DIR [options]    one experiment: a rank per device, by mpirun
#   scripts/slurm.sh array CONFIG... -- DIR [options]                    one job per configuration, each into DIR/NAME
# DEVICES: GPUs per node; 0: one rank per node that takes all of its cores.
# The job goes on from where an earlier one ended (--resume), so that it can be submitted again after its time limit.
# AMBILUX: the program; default ambilux. SBATCH_EXTRA: further #SBATCH options, such as "--time=4:00:00 --account=x".
set -euo pipefail
usage() { sed -n '2,8s/^# \{0,1\}//p' "${BASH_SOURCE[0]}" >&2; exit 2; }
program=${AMBILUX:-ambilux}
quoted() { printf ' %q' "$@"; }
header() {
  echo "#!/usr/bin/env bash"
  echo "#SBATCH --job-name=ambilux-$1"
  echo "#SBATCH --signal=B:TERM@60"
  for option in ${SBATCH_EXTRA:-}; do echo "#SBATCH $option"; done
}
whole_number() { [[ $1 =~ ^[0-9]+$ ]] || { echo "slurm: $1: a number is needed" >&2; exit 2; }; }

[[ $# -ge 2 ]] || usage
command=$1
shift
case $command in
  render | experiment)
    [[ $# -ge 3 ]] || usage
    nodes=$1 devices=$2
    shift 2
    whole_number "$nodes"
    whole_number "$devices"
    ((nodes >= 1)) || usage
    header "$command"
    echo "#SBATCH --nodes=$nodes"
    ranks=1
    if ((devices)); then
      # A rank hands over one film for all of its devices; renders of an experiment are timed on one device each.
      if [[ $command == render ]]; then
        set -- "$@" --devices "$(seq -s, 0 $((devices - 1)))"
        echo "#SBATCH --cpus-per-task=$((2 * devices))"
      else
        ranks=$devices
      fi
      echo "#SBATCH --gpus-per-node=$devices"
    else
      echo "#SBATCH --exclusive"
    fi
    echo "#SBATCH --ntasks-per-node=$ranks"
    map="--map-by ppr:$ranks:node --bind-to none"
    # exec: the signal before the time limit reaches mpirun, which passes it on and lets ranks save what they have.
    echo "exec mpirun --mca odls_base_sigkill_timeout 30 $map$(quoted "$program" "$command" "$@" --resume)"
    ;;
  array)
    configs=()
    while [[ $# -gt 0 && $1 != -- ]]; do configs+=("$1") && shift; done
    [[ ${#configs[@]} -ge 1 && $# -ge 2 ]] || usage
    folder=$2
    shift 2
    header array
    echo "#SBATCH --array=0-$((${#configs[@]} - 1))"
    echo "#SBATCH --nodes=1"
    echo "configs=($(quoted "${configs[@]}") )"
    echo 'config=${configs[$SLURM_ARRAY_TASK_ID]}'
    echo "exec$(quoted "$program") experiment \"\$config\" -o $(printf %q "$folder")/\"\$(basename \"\$config\" .toml)\"$(quoted "$@" --resume)"
    ;;
  *) usage ;;
esac
