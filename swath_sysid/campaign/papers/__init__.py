"""The published studies: their printed values as data, their trials simulated, their methods carried out again."""
